"""Other programs on the same scene, beside ours.

A peer is a command; ``{file}`` in it stands for the scene file.  It prints one JSON object a line for each of its
settings, as ``sfetcas run --json`` writes an answer, of which ``steps`` with ``factor`` and ``nodes`` (positions)
count, and with two further keys that may be left out: ``label``, and ``again``, seconds of a solve alone.  The whole
time of the command stands for each of its lines.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import tolerances
from ..equilibria.solution import Solution
from ..errors import SceneError

__all__ = ["Peer", "run_peer"]


@dataclass(frozen=True)
class Peer:
    """One setting of another program.

    Attributes
    ----------
    label : str
    seconds : float
        Of the command.
    again : float or None
        Of a solve alone, as it says itself.
    error : float
        Largest distance of a node from the reference over the size; infinite where steps or nodes are missing.
    """

    label: str
    seconds: float
    again: float | None
    error: float


def run_peer(command: str, file: Path, reference: Solution, longest: float) -> list[Peer]:
    """Run a command and compare what it prints with a reference.

    Raises
    ------
    SceneError
        It cannot be run, fails, or prints something else.
    """
    try:
        words = [word.replace("{file}", str(file)) for word in shlex.split(command)]
    except ValueError as error:
        raise SceneError(f"--peer: found {command!r}, accepted: a command ({error})") from None
    if not words:
        raise SceneError("--peer: found nothing, accepted: a command")
    begin = time.perf_counter()
    try:
        ran = subprocess.run(words, capture_output=True, text=True, errors="replace", timeout=longest, check=False)
    except (OSError, ValueError) as error:
        raise SceneError(f"--peer: found {command!r}, which cannot be run: {error}") from None
    except subprocess.TimeoutExpired:
        raise SceneError(f"--peer: found {command!r}, which took more than {longest:g} s") from None
    seconds = time.perf_counter() - begin
    lines = [line for line in ran.stdout.splitlines() if line.strip()]
    if ran.returncode or not lines:
        last = (ran.stderr.strip().splitlines() or ["nothing on its standard output"])[-1]
        raise SceneError(f"--peer: found {command!r}, which ended with {ran.returncode}: {last}")
    return [_peer(command, number, line, seconds, reference) for number, line in enumerate(lines, start=1)]


def _peer(command: str, number: int, line: str, seconds: float, reference: Solution) -> Peer:
    try:
        answer = json.loads(line)
        error = max(_apart(step, answer["steps"]) for step in reference.steps)
        again = answer.get("again")
        label = str(answer.get("label") or f"{shlex.split(command)[0]} {number}")
        return Peer(label, seconds, None if again is None else float(again), error / reference.scene.size)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        message = f"--peer: line {number} of what {command!r} printed: found {line[:60]!r}, accepted: an answer in JSON"
        raise SceneError(f"{message} with 'steps' that have 'nodes' with 'position'") from error


def _apart(step: Any, rivals: list[Mapping[str, Any]]) -> float:
    """Largest distance of the nodes that are told of, in the nearest of the steps of the same factor, m."""
    errors = [
        max(
            (float(np.linalg.norm(_three(entry["position"]) - step.position(name))))
            for name, entry in rival["nodes"].items()
        )
        for rival in rivals
        if abs(float(rival.get("factor", 1.0)) - step.factor) <= tolerances.WRITTEN * abs(step.factor)
    ]
    return min(errors, default=np.inf)


def _three(position: Any) -> Any:
    found = np.zeros(3)
    found[: len(position)] = position
    return found
