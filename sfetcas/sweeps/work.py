"""The work on chunks of cases in worker processes or on other machines."""

from __future__ import annotations

import functools
import pickle
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..analyses import solve
from ..checks import Answer
from ..description.scene import Scene
from ..dynamics.modes import Modes
from ..dynamics.motion import Trajectory
from ..equilibria.settings import Settings
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array
from ..parametric.arguments import with_values
from ..paths.path import Path
from .quantities import Wanted

__all__ = ["FAILED", "NOT_RUN", "REFUSED", "SHORT", "SOLVED", "UNANSWERED", "Job", "Outcome", "solve_chunk"]

SOLVED, SHORT, REFUSED, FAILED, NOT_RUN = "solved", "short", "refused", "failed", "not run"
"""What may become of a case; of the first two there are numbers."""

UNANSWERED = "unanswered"
"""It was solved, but the answer has no such quantity."""

ONE_AT_A_TIME = threading.Lock()
"""Solvers are not made for threads: where several share a process they take turns."""


@dataclass(frozen=True)
class Job:
    """The data that all cases share.

    Attributes
    ----------
    scene : Scene
    settings : Settings
    names : tuple of str
        Names of the numbers that change.
    wanted : tuple of Wanted
    """

    scene: Scene
    settings: Settings
    names: tuple[str, ...]
    wanted: tuple[Wanted, ...]


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case.

    Attributes
    ----------
    status, reason : str
        ``solved``, ``short``, ``refused``, ``failed`` or ``not run``; why, as a sentence, or empty.
    numbers : tuple of ndarray (k,)
        Values of each quantity, in its unit; empty without an answer.
    notes : str
        Notes of the answer.
    error_estimate : float
        Largest relative error estimate of the answer; nan where there is none.
    seconds : float
        Wall time of the solve.
    """

    status: str
    reason: str = ""
    numbers: tuple[Array, ...] = ()
    notes: str = ""
    error_estimate: float = np.nan
    seconds: float = np.nan


@functools.lru_cache(maxsize=2)
def _job(data: bytes) -> Job:
    found = pickle.loads(data)
    assert isinstance(found, Job)
    return found


def solve_chunk(data: bytes, values: Sequence[Sequence[float]]) -> list[Outcome]:
    """Solve a chunk of cases, each independently.

    Parameters
    ----------
    data : bytes
        The pickled :class:`Job`, which a process unpacks once.
    values : sequence
        For each case the values of the numbers that change.
    """
    with ONE_AT_A_TIME:
        return [_outcome(_job(data), case) for case in values]


def _outcome(job: Job, values: Sequence[float]) -> Outcome:
    begin = time.perf_counter()
    try:
        with np.errstate(over="raise"):
            scene = with_values(job.scene, dict(zip(job.names, values, strict=True)))
            # What is expected says at which times and factors there are answers.
            scene = scene.model_copy(update={"expect": job.scene.expect})
            begin = time.perf_counter()
            answer = solve(scene, job.settings)
            seconds = time.perf_counter() - begin
    except SceneError as error:
        return Outcome(REFUSED, str(error), seconds=time.perf_counter() - begin)
    except SolveError as error:
        return Outcome(FAILED, str(error), seconds=time.perf_counter() - begin)
    except (FloatingPointError, OverflowError, np.linalg.LinAlgError) as error:
        message = f"the numbers of this case leave what can be computed ({error})"
        return Outcome(FAILED, message, seconds=time.perf_counter() - begin)
    except MemoryError:
        return Outcome(FAILED, "the case needs more memory than there is", seconds=time.perf_counter() - begin)
    return _answered(job, answer, seconds)


def _answered(job: Job, answer: Answer, seconds: float) -> Outcome:
    try:
        numbers = tuple(one.numbers(answer) for one in job.wanted)
    except SceneError as error:
        return Outcome(UNANSWERED, str(error), seconds=seconds)
    solved = answer.status is Status.SOLVED
    lacking = [f"there is no {one.text}" for one, found in zip(job.wanted, numbers, strict=True) if not found.size]
    return Outcome(
        SOLVED if solved else SHORT,
        "" if solved else answer.status.value,
        numbers,
        "; ".join([*lacking, *_notes(answer)]),
        _error_estimate(answer),
        seconds,
    )


def _notes(answer: Answer) -> list[str]:
    own = [] if isinstance(answer, Trajectory) else [note for step in answer.steps for note in step.notes]
    return list(dict.fromkeys([*own, *getattr(answer, "notes", ())]))


def _error_estimate(answer: Answer) -> float:
    if isinstance(answer, (Path, Trajectory, Modes)):
        found = [answer.error_estimate]
    else:
        found = [step.certificate.error_estimate for step in answer.steps]
    return max((estimate for estimate in found if estimate is not None), default=np.nan)
