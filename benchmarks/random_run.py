"""Random scenes solved by the thousand, each answer looked at and asked again; part of ``python -m benchmarks``.

``python -m benchmarks random [--count 1000] [--first 0] [--seconds 30] [--processes 1]`` prints a summary in
Markdown, and before it a line for each scene that is more than solved and the same every way.
"""

from __future__ import annotations

import argparse
import functools
import statistics
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from sfetcas.equilibria.solution import Solution
from sfetcas.equilibria.statics import solve
from sfetcas.errors import SceneError, SolveError

from .random_checks import VARIANTS, compared, variant, wrong
from .random_scenes import random_scene
from .worker import Worker

__all__ = ["Outcome", "random_run", "random_scenes"]


@dataclass
class Outcome:
    """What became of one scene.

    Attributes
    ----------
    seed : int
    kind : solved, or the kind of what was said instead
    seconds : of the solve
    told : what is wrong with the answer, or the sentence that refused it
    others : the same scene otherwise, by the name of the variant
    """

    seed: int
    kind: str
    seconds: float
    words: str = ""
    others: dict[str, str] = field(default_factory=dict)


@functools.lru_cache(maxsize=1)
def _solved(seed: int) -> tuple[str, str, float, Solution | None]:
    """Kind, sentence, seconds and answer of a scene; in the worker the answer stays for its variants."""
    scene, begin = random_scene(seed), time.perf_counter()
    try:
        answer = solve(scene)
    except SceneError as error:
        return f"refused: {_words(str(error))}", str(error), time.perf_counter() - begin, None
    except SolveError as error:
        return f"no solution: {error.status.value}", str(error), time.perf_counter() - begin, None
    seconds, bad = time.perf_counter() - begin, ", ".join(wrong(answer.last))
    kind = "WRONG" if bad else answer.status.value
    return kind, bad, seconds, answer


def _words(sentence: str) -> str:
    """What sentences of one kind have in common: up to the first name or number."""
    return sentence.split(":")[0]


def _first(seed: int) -> tuple[str, str, float]:
    return _solved(seed)[:3]


def _asked(seed: int, name: str) -> str:
    """One variant of a scene that was solved."""
    scene, answer = random_scene(seed), _solved(seed)[3]
    if answer is None or (name == "space" and scene.resolved_dimension == "space"):
        return ""
    return compared(answer.last, variant(name, scene, answer.last, seed))


def _outcomes(worker: Worker, seeds: Sequence[int]) -> Iterator[Outcome]:
    for seed in seeds:
        found, failed = worker.ask(_first, seed)
        if found is None:
            yield Outcome(seed, failed.partition(":")[0], worker.seconds, failed)
            continue
        kind, words, seconds = found
        outcome = Outcome(seed, kind, seconds, words)
        if kind.startswith(("solved", "WRONG")):
            for name in VARIANTS:
                said, failed = worker.ask(_asked, seed, name)
                if said != "":
                    outcome.others[name] = failed or said
        yield outcome


def random_run(seeds: Sequence[int], seconds: float = 30.0, processes: int = 1) -> Iterator[Outcome]:
    """What became of the scenes of these seeds, each solve in no more than so many seconds."""
    lanes = [Worker(seconds) for _ in range(processes)]
    try:
        with ThreadPoolExecutor(processes) as threads:
            rounds = [seeds[i : i + processes] for i in range(0, len(seeds), processes)]
            for part in rounds:
                pairs = zip(lanes, part, strict=False)
                yield from threads.map(lambda pair: next(_outcomes(pair[0], [pair[1]])), list(pairs))
    finally:
        for lane in lanes:
            lane.close()


def random_scenes(arguments: Sequence[str] = ()) -> None:
    """Run scenes at random and print what became of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks random")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--processes", type=int, default=1)
    asked = parser.parse_args(arguments)
    outcomes = []
    for outcome in random_run(range(asked.first, asked.first + asked.count), asked.seconds, asked.processes):
        outcomes.append(outcome)
        for line in _remarkable(outcome):
            print(line, flush=True)
    print("\n".join(_summary(outcomes)))


def _kind_of(said: str) -> str:
    return said.partition(":")[0].partition(" (")[0].partition(" by ")[0]


def _remarkable(outcome: Outcome) -> Iterator[str]:
    """Lines on a scene that is more than solved and the same every way."""
    if outcome.kind != "solved":
        yield f"- {outcome.seed}: {outcome.kind} ({outcome.seconds:.1f} s): {outcome.words}"
    for name, said in outcome.others.items():
        if said != "same":
            yield f"- {outcome.seed}, {name}: {said}"


def _summary(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Tables in Markdown."""
    yield f"\n| of {len(outcomes)} scenes | | seconds, median | worst |\n|---|---|---|---|"
    kinds = Counter(outcome.kind for outcome in outcomes)
    for kind, count in kinds.most_common():
        seconds = [outcome.seconds for outcome in outcomes if outcome.kind == kind]
        yield f"| {kind} | {count} | {statistics.median(seconds):.2f} | {max(seconds):.1f} |"
    yield "\n| otherwise | " + " | ".join(VARIANTS) + " |\n|---|" + "---|" * len(VARIANTS)
    said = {name: Counter(_kind_of(o.others[name]) for o in outcomes if name in o.others) for name in VARIANTS}
    for kind in sorted({kind for counter in said.values() for kind in counter}):
        yield f"| {kind} | " + " | ".join(str(said[name][kind]) for name in VARIANTS) + " |"
