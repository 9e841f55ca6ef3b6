"""The same scene put otherwise by what nobody means: every answer has to stay what it is.

``python -m benchmarks jitter [--count 300] [--first 0] [--changes 5] [--seconds 30] [FILE ...]`` solves scene
files, or random scenes where none are named, as they are and so changed, and prints what differs.
"""

from __future__ import annotations

import argparse
import functools
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path as File
from typing import Any

import numpy as np

from sfetcas.analyses import solve
from sfetcas.checks import Answer
from sfetcas.description.scene import Scene
from sfetcas.description.scenefile import load
from sfetcas.dynamics.modes import Modes
from sfetcas.dynamics.motion import Trajectory
from sfetcas.equilibria.solution import Equilibrium, Solution
from sfetcas.errors import SceneError, SolveError
from sfetcas.mathematics.arrays import Array
from sfetcas.paths.path import Path

from .random_scenes import random_scene, reordered, transformed
from .worker import Worker

__all__ = ["Jittered", "differences", "jitter", "jittered"]

LEAST, MOST = -15.0, -13.0
"""Changes of numbers, as powers of ten: rounding of what other programs write and of other processors."""

ODD = {"length": 0.3048, "force": 4.4482216, "time": 0.7071}
"""Units that are no powers of two or ten."""

PLACES = np.linspace(0.0, 1.0, 5)
"""Where answers are compared along members."""

ROUGH = 1e-2
"""Share of the largest by which forces may differ; what is not the same differs by much, or in a note."""

NUMBER = re.compile(r"[-+(]*\d[\d.,]*(?:e[-+]?\d+)?\)*|\b[xyz]\b")
"""Numbers, and names of axes, in notes."""


@dataclass(frozen=True)
class Jittered:
    """A scene otherwise, and the way back of what it answers.

    Attributes
    ----------
    scene : Scene
    turn : ndarray (3, 3)
        Rotation of the axes.
    length, force, time : new units of the old ones
    """

    scene: Scene
    turn: Array
    length: float
    force: float
    time: float

    def back(self, vectors: Any, length: int = 0, force: int = 0, time: int = 0) -> Array:
        """Vectors (..., 3) of an answer in the axes and units of the first scene, by the powers of their units."""
        return np.asarray(vectors) @ self.turn / (self.length**length * self.force**force * self.time**time)


def jittered(scene: Scene, seed: int) -> Jittered:
    """A scene changed by rounding, in another order, in other axes and units.

    Places move by 1e-15 to 1e-13 of the size, all other numbers by as much of themselves; nodes, members, loads and
    all else stand in another order; axes are taken to each other, in the plane x to y or both turned round.
    """
    rng = np.random.default_rng([seed, 77])
    space = scene.resolved_dimension == "space"
    axes = [np.roll(np.eye(3), k, axis=0) for k in (1, 2)] if space else []
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    axes += [] if space else [quarter, quarter @ quarter, quarter.T]
    turn = axes[int(rng.integers(len(axes)))]
    units = {name: float(unit ** rng.integers(-2, 3)) for name, unit in ODD.items()}
    table = scene.to_dict()
    table.pop("expect", None)
    table["dimension"] = scene.resolved_dimension
    table = transformed(reordered(table, seed), turn, (0.0, 0.0, 0.0), *units.values())
    share = 10.0 ** rng.uniform(LEAST, MOST)
    flat = np.ones(3) if space else np.array([1.0, 1.0, 0.0])
    for node in table["nodes"].values():
        place = np.array(node["position"]) + share * units["length"] * scene.size * rng.uniform(-1, 1, 3) * flat
        node["position"] = place.tolist()
    for kind, keys in {"sections": ("EI2", "EI3", "GJ", "rhoA"), "springs": ("stiffness",)}.items():
        for entry in table.get(kind, {}).values():
            entry |= {k: entry[k] * (1.0 + share * rng.uniform(-1, 1)) for k in keys if isinstance(entry.get(k), float)}
    for load_ in table.get("loads", {}).values():
        value = np.array(load_["value"])
        # A plane load of one axis gets a little of the other.
        value = value + share * np.abs(value).max() * rng.uniform(-1, 1, 3) * _free(load_, flat)
        load_["value"] = value.tolist()
    return Jittered(Scene.from_dict(table), turn, **units)


def _free(load_: dict[str, Any], flat: Array) -> Array:
    return flat if load_["type"] != "moment" or flat[2] else 1.0 - flat


# What answers have in common


@dataclass
class _Outputs:
    """What is compared of an answer: words, and numbers with their tolerance."""

    words: dict[str, Any] = field(default_factory=dict)
    numbers: dict[str, tuple[Array, float]] = field(default_factory=dict)

    def add(self, name: str, values: Any, tolerance: float) -> None:
        """Numbers by a name."""
        self.numbers[name] = np.atleast_1d(np.asarray(values, dtype=float)), tolerance


def _outputs(answer: Answer, how: Jittered) -> _Outputs:
    """An answer in the axes and units of the first scene."""
    outputs = _Outputs({"status": answer.status.value})
    size = how.scene.size / how.length
    if isinstance(answer, Solution):
        entries = list(answer.steps)
        if how.scene.analysis.equilibria == "all":
            # A family, or the members of equal energy, stand in any order.
            outputs.words["count"] = len(entries)
            entries = entries[:1]
        for i, step in enumerate(entries):
            _equilibrium(outputs, f"step {i}", step, how, size)
    elif isinstance(answer, Path):
        outputs.words["notes"] = said(answer.notes)
        estimate = max(answer.error_estimate or 0.0, 1e-7)
        for kind in ("limit_points", "bifurcations", "flutter_points", "transitions"):
            found = getattr(answer, kind)
            outputs.words[kind] = len(found)
            # The path has a unit of the factors; each is right to the error relative to the largest.
            factors = [entry.factor for entry in found]
            outputs.add(kind, factors, 10.0 * estimate * max(map(abs, factors), default=0.0))
        outputs.words["crossings"] = len(answer.steps)
        for i, step in enumerate(answer.steps):
            _equilibrium(outputs, f"crossing {i}", step, how, size)
    elif isinstance(answer, Modes):
        outputs.words["notes"], outputs.words["rigid"] = said(answer.notes), answer.rigid
        omegas = np.array([mode.omega for mode in answer.modes]) * how.time
        outputs.add("omega", omegas, (2.0 * answer.error_estimate + 1e-6) * float(omegas.max(initial=0.0)))
        for i, mode in enumerate(answer.modes):
            # Other axes may turn a shape round, and more a phase.
            moved = np.concatenate([how.back(mode.nodes[name]["position"]) for name in sorted(mode.nodes)])
            outputs.add(f"shape {i}", np.outer(moved, moved.conj()).real, ROUGH)
    elif isinstance(answer, Trajectory):
        outputs.words["notes"] = said(answer.notes)
        reach = (2.0 * (answer.error_estimate or 1e-6) + 1e-9) * size
        for name in how.scene.nodes:
            places = np.array([instant.position(name) for instant in answer.steps])
            outputs.add(f"nodes.{name}", how.back(places, 1), reach)
    return outputs


def _equilibrium(outputs: _Outputs, name: str, step: Equilibrium, how: Jittered, size: float) -> None:
    proof, error = step.certificate, step.certificate.error_estimate or 0.0
    outputs.words[f"{name} stable"], outputs.words[f"{name} negative"] = str(proof.stable), proof.negative
    outputs.words[f"{name} notes"] = said(step.notes)
    if proof.error_of:
        return
    inside = 0.0
    for member in step.model.scene.members:
        along = step.along(member, PLACES)
        places, inside = how.back(along["position"], 1), max(inside, float(np.abs(along["force"]).max()))
        # Each is right to its estimate; rounding leaves less than a millionth.  Of a neutral family any is right: its
        # energy says whether it is the same one, and places stay near as long as rounding alone moves along it.
        near = ROUGH if proof.stable == "neutral" else error + 1e-6
        outputs.add(f"{name} members.{member}", places, near * size)
    supported = [node for node, entry in step.model.scene.nodes.items() if entry.support != "free"]
    forces = {node: how.back(step.reaction(node)[0], 0, 1) for node in supported}
    acts = max((float(np.abs(force).max()) for force in forces.values()), default=0.0)
    carried = max(acts, inside / how.force)
    # Forces, those inside members too, work on the places that are changed.
    energies = np.array([step.energy["elastic"], step.energy["loads"]]) / (how.length * how.force)
    outputs.add(
        f"{name} energy",
        energies,
        (error + 1e-6) * float(np.abs(energies).sum()) + 10.0 ** (MOST + 1.0) * carried * size,
    )
    for node, force in forces.items():
        outputs.add(f"{name} reactions.{node}", force, ROUGH * acts + 1e-6)


def said(notes: Sequence[str]) -> tuple[str, ...]:
    """The words of notes, in an order of their own: numbers, axes and the order of names left out.

    A joint of several members is called by the first of them in the file: of redundant rows no names are compared.
    """
    kept = [NUMBER.sub("#", note.partition("redundant:")[0]) for note in notes]
    return tuple(sorted({" ".join(sorted(set(re.split(r"[\s,;:()]+", note)))) for note in kept}))


def differences(scene: Scene, change: Jittered, answer: Answer | str | None = None) -> list[str]:
    """What a scene answers otherwise when it is put otherwise; empty where all is the same.

    Parameters
    ----------
    scene : Scene
    change : Jittered
    answer : optional
        Of the scene, if it is there, or the kind of the refusal.
    """
    one, other = answered(scene) if answer is None else answer, answered(change.scene)
    if isinstance(one, str) or isinstance(other, str):
        kinds = [found if isinstance(found, str) else found.status.value for found in (one, other)]
        return [] if kinds[0] == kinds[1] else [f"{kinds[0]} / {kinds[1]}"]
    mine, its = _outputs(one, Jittered(scene, np.eye(3), 1.0, 1.0, 1.0)), _outputs(other, change)
    found = [f"{n}: {word} / {its.words.get(n)}" for n, word in mine.words.items() if word != its.words.get(n)]
    for name, (values, allowed) in mine.numbers.items():
        theirs, too = its.numbers.get(name, (np.zeros(0), 0.0))
        if theirs.shape != values.shape:
            found.append(f"{name}: {len(values)} / {len(theirs)} entries")
        elif not np.abs(theirs - values).max(initial=0.0) <= allowed + too:
            found.append(f"{name}: apart by {np.abs(theirs - values).max():.1e}, accepted {allowed + too:.1e}")
    return found


def answered(scene: Scene) -> Answer | str:
    """The answer, or how it was refused: its kind, and the words without numbers and names of axes."""
    try:
        return solve(scene)
    except (SceneError, SolveError) as error:
        status = error.status.value if isinstance(error, SolveError) else "refused"
        return f"{status}: {said([str(error).partition(':')[0]])[0]}"


# The benchmark


@functools.lru_cache(maxsize=1)
def _first(which: int | str) -> tuple[Scene, Answer | str]:
    # What is expected is said in the first units, and its times are among the answers.
    scene = random_scene(which) if isinstance(which, int) else load(which).replace(expect=())
    return scene, answered(scene)


def _ready(which: int | str) -> str:
    found = _first(which)[1]
    return found.partition(":")[0] if isinstance(found, str) else found.status.value


def _changed(which: int | str, seed: int) -> list[str]:
    scene, answer = _first(which)
    return differences(scene, jittered(scene, seed), answer)


def _run(scenes: Sequence[int | str], changes: int, seconds: float) -> Iterator[tuple[int | str, str, list[str]]]:
    """Each scene, what became of it, and a line for each change that is not the same."""
    worker = Worker(seconds)
    try:
        for which in scenes:
            became, failed = worker.ask(_ready, which)
            lines: list[str] = []
            if became is not None:
                for seed in range(changes):
                    found, slow = worker.ask(_changed, which, seed)
                    lines += (
                        [f"change {seed}: {'; '.join(found) if found is not None else slow}"] if found != [] else []
                    )
            yield which, became or failed, lines
    finally:
        worker.close()


def jitter(arguments: Sequence[str] = ()) -> None:
    """Put scenes otherwise and print what differs."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks jitter")
    parser.add_argument("files", nargs="*", help="scene files; left out, random scenes")
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--changes", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=30.0)
    asked = parser.parse_args(arguments)
    scenes = [*asked.files] or [*range(asked.first, asked.first + asked.count)]
    became: Counter[str] = Counter()
    same: Counter[str] = Counter()
    for which, kind, lines in _run(scenes, asked.changes, asked.seconds):
        became[kind] += 1
        same[kind] += not lines
        for line in lines:
            print(f"- {File(str(which)).name}, {kind}, {line}", flush=True)
    print("\n| scenes | of these | the same each time |\n|---|---|---|")
    for kind, count in became.most_common():
        print(f"| {kind} | {count} | {same[kind]} |")
