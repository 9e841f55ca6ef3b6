"""Contact at random against chains of rigid links; part of ``python -m benchmarks``.

``python -m benchmarks contact [--count 25] [--first 0] [--seconds 30] [--family NAME] [--save FOLDER]`` prints
a table in Markdown, and before it a line for each scene that is not simply right.
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

from sfetcas.analyses import solve
from sfetcas.description.scene import Scene
from sfetcas.description.scenefile import dump
from sfetcas.errors import SceneError, SolveError

from .contact_chain import QUARTERS, NotAChainError
from .contact_oracle import NARROW, WIDTHS, ChainAnswer, chain_contact
from .contact_scenes import FAMILIES, contact_scene
from .worker import Worker

__all__ = ["ContactOutcome", "compare_contact", "contact"]

KINDS = ("right", "right, jump untold", "told", "undecided", "SILENT", "refused", "slow", "no chain")
"""The same state; the same without a word of the jump that leads there; another state and a note that says of a jump
or an unstable state; another one, by paths and many steps no better known; another one without a word; no answer; no
answer in time; no answer of the chain."""

APART = 6e-3
"""Distance over the size beyond which states differ, besides the chain's own error."""

OTHERWISE: dict[str, dict[str, Any]] = {
    "path": {"type": "path", "range": [0.0, 1.0], "steps": [1.0]},
    "steps": {"steps": [round(0.05 * i, 2) for i in range(1, 21)]},
}
"""Other ways to factor 1, asked where the two disagree."""


@dataclass(frozen=True)
class ContactOutcome:
    """What became of one scene.

    Attributes
    ----------
    family, seed : str, int
    kind : str
        One of KINDS.
    seconds : float
        CPU time of the solve.
    told : str
        What the solve and the chain say.
    touching, snapped : bool
        Whether the chain touches an obstacle in the end, and whether it lost stability on the way.
    """

    family: str
    seed: int
    kind: str
    seconds: float
    words: str
    touching: bool = False
    snapped: bool = False


@dataclass(frozen=True)
class _Said:
    """What a solve says: places of members at factor 1, notes; or the refusal."""

    places: dict[str, Any] | None
    notes: tuple[str, ...]
    seconds: float


def _solved(table: dict[str, Any], seconds: float) -> _Said:
    """A solve in a worker, which ends itself after so many seconds of CPU time."""
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    begin = time.process_time()
    try:
        answer: Any = solve(Scene.from_dict(table))
    except (SceneError, SolveError) as error:
        return _Said(None, (str(error),), time.process_time() - begin)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    taken = time.process_time() - begin
    steps = [step for step in answer.steps if abs(step.factor - 1.0) < 1e-9]
    notes = tuple(dict.fromkeys((*getattr(answer, "notes", ()), *(note for step in steps for note in step.notes))))
    if not steps:
        return _Said(None, ("factor 1 is not met", *notes), taken)
    places = {name: np.asarray(steps[0].along(name, QUARTERS)["position"]) for name in table["members"]}
    return _Said(places, notes, taken)


def _chained(table: dict[str, Any], seconds: float, widths: Sequence[float] = WIDTHS) -> ChainAnswer | str:
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        return chain_contact(table, widths=widths)
    except NotAChainError as error:
        return str(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _apart(said: _Said, chain: ChainAnswer) -> float:
    """Largest distance of places along members, over the size."""
    assert said.places is not None
    return max(float(np.abs(said.places[name] - chain.members[name]).max()) for name in chain.members) / chain.size


def _of_jump(notes: Sequence[str]) -> bool:
    return any(word in note for note in notes for word in ("jump", "left an unstable", "snap", "unstable"))


def compare_contact(family: str, seed: int, worker: Worker, seconds: float) -> ContactOutcome:
    """One scene solved both ways."""
    table = contact_scene(family, seed)
    chain, failed = worker.ask(_chained, table, seconds)
    if not isinstance(chain, ChainAnswer):
        return ContactOutcome(family, seed, "no chain", 0.0, str(chain or failed))
    kind, taken, words = _judged(table, chain, worker, seconds)
    return ContactOutcome(family, seed, kind, taken, words, bool(chain.touches), chain.snapped)


def _judged(table: dict[str, Any], chain: ChainAnswer, worker: Worker, seconds: float) -> tuple[str, float, str]:
    """Kind, CPU seconds and words of a scene of which the chain is known."""
    said, failed = worker.ask(_solved, table, seconds)
    snaps = f"chain snaps at {', '.join(f'{s:.3f}' for s in chain.snaps) or 'none'}, error {chain.error:.1e}"
    if said is None:
        kind = "slow" if failed in ("CRASH", "too slow") else "refused"
        return kind, seconds, f"{failed}; {snaps}"
    words = "; ".join((*said.notes, snaps))
    if said.places is None:
        return "refused", said.seconds, words
    apart, most = _apart(said, chain), APART + 3.0 * chain.error / chain.size
    if apart <= most:
        kind = "right, jump untold" if chain.snapped and not _of_jump(said.notes) else "right"
        return kind, said.seconds, words
    if chain.snapped:
        # Soft obstacles may make it snap before its time.
        harder, _ = worker.ask(_chained, table, seconds, NARROW)
        if isinstance(harder, ChainAnswer) and not harder.snapped and _apart(said, harder) <= most:
            return "right", said.seconds, f"{words}, none with narrow obstacles"
    words = f"apart by {apart:.3f}; {words}"
    if not chain.agree:
        return "undecided", said.seconds, words
    kind = "told" if _of_jump(said.notes) else "SILENT"
    votes = []
    for name, analysis in OTHERWISE.items():
        other, failed = worker.ask(_solved, table | {"analysis": analysis}, seconds)
        if other is None or other.places is None:
            votes.append(f"{name}: {failed or other.notes[0]}")
            continue
        with_chain = _apart(other, chain) <= most
        same = max(float(np.abs(other.places[k] - said.places[k]).max()) for k in said.places) < APART * chain.size
        votes.append(f"{name}: {'as the chain' if with_chain else 'as the solve' if same else 'another'}")
    if kind == "SILENT" and not any("as the chain" in vote for vote in votes):
        kind = "undecided" if not chain.snapped and any("as the solve" in vote for vote in votes) else kind
    return kind, said.seconds, "; ".join((words, *votes))


def contact(arguments: Sequence[str] = ()) -> None:
    """Run scenes of contact at random and print what became of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks contact")
    parser.add_argument("--count", type=int, default=25, help="scenes of each family")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=30.0, help="CPU time of a solve")
    parser.add_argument("--family", choices=FAMILIES)
    parser.add_argument("--save", type=Path, help="folder for the scenes that are not right")
    asked = parser.parse_args(arguments)
    if asked.save:
        asked.save.mkdir(parents=True, exist_ok=True)
    worker, outcomes = Worker(10.0 * asked.seconds), []
    families = [asked.family] if asked.family else list(FAMILIES)
    try:
        for seed in range(asked.first, asked.first + asked.count):
            for family in families:
                outcome = compare_contact(family, seed, worker, asked.seconds)
                outcomes.append(outcome)
                if outcome.kind != "right":
                    print(f"- {family} {seed}: {outcome.kind} ({outcome.seconds:.1f} s): {outcome.words}", flush=True)
                    if asked.save:
                        name = f"{outcome.kind.partition(',')[0].replace(' ', '_')}_{family}_{seed}.toml"
                        dump(Scene.from_dict(contact_scene(family, seed)), asked.save / name)
    finally:
        worker.close()
    print("\n".join(_summary(outcomes)))


def _summary(outcomes: Sequence[ContactOutcome]) -> Iterator[str]:
    """A table in Markdown."""
    yield "\n| family | scenes | touching | with a snap | " + " | ".join(KINDS) + " | seconds, median | worst |"
    yield "|---|" + "---|" * (len(KINDS) + 5)
    for family in dict.fromkeys(outcome.family for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.family == family]
        kinds = Counter(outcome.kind for outcome in own)
        seconds = [outcome.seconds for outcome in own]
        counts = " | ".join(str(kinds[kind]) for kind in KINDS)
        state = f"{sum(o.touching for o in own)} | {sum(o.snapped for o in own)}"
        yield f"| {family} | {len(own)} | {state} | {counts} | {np.median(seconds):.2f} | {max(seconds):.1f} |"
