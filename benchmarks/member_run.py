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

import numpy as np

from sfetcas.analyses import solve
from sfetcas.description.scene import Scene
from sfetcas.description.scenefile import dump
from sfetcas.errors import SceneError, SolveError

from .member_checks import touches, wrong_contacts
from .member_scenes import KINDS, member_scene
from .worker import Worker

__all__ = ["MemberOutcome", "members", "tried"]

ENDS = ("solved", "refused", "WRONG", "ERROR", "slow")
"""All fits; no answer but a sentence; something does not fit; another exception than of the library; no answer in time."""


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
    scene = Scene.from_dict(member_scene(kind, seed))
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    begin = time.process_time()
    try:
        answer = solve(scene)
    except (SceneError, SolveError) as error:
        return MemberOutcome(kind, seed, "refused", time.process_time() - begin, str(error))
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    taken = time.process_time() - begin
    words = [f"at {step.factor:g}: {word}" for step in answer.steps for word in wrong_contacts(step)]
    words = words[:4] + ["..."] * (len(words) > 4)
    said = list(dict.fromkeys(note for step in answer.steps for note in step.notes)) if words else []
    end = "WRONG" if words else "solved"
    return MemberOutcome(kind, seed, end, taken, "; ".join(words + said), len(touches(answer.last)))


def members(arguments: Sequence[str] = ()) -> None:
    """Run scenes in which members touch each other at random and print what became of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks members")
    parser.add_argument("--count", type=int, default=25, help="scenes of each kind")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60.0, help="CPU time of a solve")
    parser.add_argument("--kind", choices=list(KINDS))
    parser.add_argument("--save", type=Path, help="folder for the scenes that are not solved")
    asked = parser.parse_args(arguments)
    worker, outcomes = Worker(5.0 * asked.seconds), list[MemberOutcome]()
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
                    if asked.save:
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
