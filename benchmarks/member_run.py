"""Contact between members at random, each answer looked at from outside; part of ``python -m benchmarks``.

``python -m benchmarks members [--count 25] [--first 0] [--seconds 60] [--kind NAME] [--save FOLDER]`` prints a table in
Markdown, and before it a line for each scene that is not simply solved.
"""

from __future__ import annotations

import argparse
import signal
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sfetcas.description.scene import Scene
from sfetcas.description.scenefile import dump
from sfetcas.equilibria import statics
from sfetcas.equilibria.solution import Equilibrium
from sfetcas.errors import SceneError, SolveError

from .contact_chain import QUARTERS, NotAChainError
from .member_checks import touches, wrong_contacts
from .member_oracle import LINKS, RodAnswer, near_answer, rods_in_contact
from .member_scenes import KINDS, member_scene
from .worker import Worker

__all__ = ["MemberOutcome", "members", "tried"]

ENDS = ("solved", "unchecked", "told", "OTHER", "refused", "WRONG", "ERROR", "slow")
"""All fits, and the chain is there too; there is no chain; the chain is elsewhere and a note says of a jump; it is
elsewhere without a word; no answer but a sentence; something does not fit; another exception than of the library; no
answer in time.
"""

APART, FORCES = 1e-3, 0.02
"""Distance over the size, and difference of contact forces over the largest, beyond which states differ, besides the
chain's own errors.
"""


@dataclass(frozen=True)
class MemberOutcome:
    """What became of one scene.

    Attributes
    ----------
    kind, seed : str, int
    end : str
        One of ENDS.
    seconds : float
        CPU time of the solve.
    words : str
        What is wrong, or the sentence that refused.
    places : int
        Where members touch, in the last step.
    """

    kind: str
    seed: int
    end: str
    seconds: float
    words: str = ""
    places: int = 0


def tried(kind: str, seed: int, seconds: float) -> MemberOutcome:
    """One scene solved and looked at, in a process that ends itself after so many seconds of CPU time."""
    table = member_scene(kind, seed)
    scene = Scene.from_dict(table)
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    begin = time.process_time()
    try:
        answer = statics.solve(scene)
    except (SceneError, SolveError) as error:
        taken = time.process_time() - begin
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        return MemberOutcome(kind, seed, "refused", taken, f"{_chained(table, None)[1]}; {error}")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    taken = time.process_time() - begin
    words = [f"at {step.factor:g}: {word}" for step in answer.steps for word in wrong_contacts(step)]
    words = words[:4] + ["..."] * (len(words) > 4)
    said = list(dict.fromkeys(note for step in answer.steps for note in step.notes))
    same, chained = _chained(table, answer.last)
    jump = any(word in note for note in said for word in ("jump", "unstable"))
    end = "WRONG" if words else same if same != "OTHER" or not jump else "told"
    return MemberOutcome(kind, seed, end, taken, "; ".join([*words, chained, *said]), len(touches(answer.last)))


def _chained(table: dict[str, Any], step: Equilibrium | None) -> tuple[str, str]:
    """What the chain says of an answer: solved, unchecked or OTHER, and words."""
    try:
        found = rods_in_contact(table)
    except NotAChainError as error:
        return "unchecked", f"no chain: {error}"
    if step is None or _same(step, found):
        return "unchecked" if step is None else "solved", _said(found)
    words = f"chain {_apart(step, found):.1e} away, {_said(found)}, energy of the answer {step.energy['total']:.6g}"
    try:
        finer = near_answer(table, step, 2 * LINKS[3 if table["dimension"] == "space" else 2])
    except NotAChainError as error:
        return "OTHER", f"{words}; from the answer no chain: {error}"
    words += f"; from the answer {_apart(step, finer):.1e} away, {_said(finer)}"
    # Where the finer chain is between both, the coarse one was not fine enough.
    between = max(float(np.abs(there - found.members[name]).max()) for name, there in finer.members.items())
    near = _same(step, finer) and between <= 10.0 * (found.error + finer.error)
    return "solved" if near else "OTHER", words


def _apart(step: Equilibrium, found: RodAnswer) -> float:
    """Largest distance of places along members, m."""
    return max(
        float(np.abs(step.along(name, QUARTERS)["position"] - there).max()) for name, there in found.members.items()
    )


def _same(step: Equilibrium, found: RodAnswer) -> bool:
    """Whether places and forces are the same, besides the errors of the chain."""
    force = sum(float(np.linalg.norm(one.force)) for one in touches(step))
    beside = abs(force - sum(found.forces.values())) - 3.0 * len(found.forces) * found.force_error
    return _apart(step, found) <= APART * found.size + 1.5 * found.error and beside <= FORCES * max(force, 1e-3)


def _said(found: RodAnswer) -> str:
    words = f"chain's error {found.error:.1e}, force {sum(found.forces.values()):.4g}, energy {found.energy:.6g}"
    return words + (f", snaps {', '.join(f'{s:.3f}' for s in found.snaps)}" if found.snaps else "")


def members(arguments: Sequence[str] = ()) -> None:
    """Run scenes in which members touch each other at random and print what became of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks members")
    parser.add_argument("--count", type=int, default=25, help="scenes of each kind")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60.0, help="CPU time of a solve")
    parser.add_argument("--kind", choices=list(KINDS))
    parser.add_argument("--save", type=Path, help="folder for the scenes that are not solved")
    asked = parser.parse_args(arguments)
    if asked.save:
        asked.save.mkdir(parents=True, exist_ok=True)
    worker, outcomes = Worker(3.0 * asked.seconds + 120.0), list[MemberOutcome]()
    try:
        for seed in range(asked.first, asked.first + asked.count):
            for kind in [asked.kind] if asked.kind else KINDS:
                found, failed = worker.ask(tried, kind, seed, asked.seconds)
                if found is None:
                    end = "slow" if failed in ("CRASH", "too slow") else "ERROR"
                    found = MemberOutcome(kind, seed, end, asked.seconds, failed)
                outcomes.append(found)
                if found.end != "solved":
                    print(f"- {kind} {seed}: {found.end} ({found.seconds:.1f} s): {found.words}", flush=True)
                    if asked.save and found.end != "unchecked":
                        name = f"{found.end}_{kind}_{seed}.toml"
                        dump(Scene.from_dict(member_scene(kind, seed)), asked.save / name)
    finally:
        worker.close()
    print("\n".join(_summary(outcomes)))


def _summary(outcomes: Sequence[MemberOutcome]) -> Iterator[str]:
    """A table in Markdown."""
    yield "\n| kind | scenes | touching | " + " | ".join(ENDS) + " | seconds, median | 90 % | worst |"
    yield "|---|" + "---|" * (len(ENDS) + 5)
    for kind in dict.fromkeys(outcome.kind for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.kind == kind]
        ends, seconds = Counter(outcome.end for outcome in own), [outcome.seconds for outcome in own]
        counts = " | ".join(str(ends[end]) for end in ENDS)
        spread = f"{np.median(seconds):.2f} | {np.quantile(seconds, 0.9):.1f} | {max(seconds):.1f}"
        yield f"| {kind} | {len(own)} | {sum(o.places > 0 for o in own)} | {counts} | {spread} |"
