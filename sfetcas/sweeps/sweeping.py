"""The sweep of a scene over many cases, each solved independently by an executor."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor

import numpy as np
from numpy.typing import ArrayLike

from ..description.records import say, whole
from ..description.scene import Scene, check_scene
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..processes import cores
from .batch import batch_of, outcomes_of
from .cases import Cases, cases_from
from .feeding import chunk_of, fed
from .outcomes import Outcomes
from .quantities import Wanted, wanted_of
from .result import Sweep, gathered
from .work import NOT_RUN, Job, Outcome
from .workers import MOST_WORKERS, Workers

__all__ = ["sweep"]


def sweep(
    scene: Scene,
    cases: Cases | Mapping[str, ArrayLike],
    quantities: Sequence[str],
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    settings: Settings | None = None,
    chunk: int | None = None,
    progress: Callable[[int], object] | None = None,
    batch: bool = False,
    warm: bool = False,
) -> Sweep:
    """Solve a scene with other numbers in each of many cases.

    Each case is ``solve(changed(scene, case), settings)``, in the plane or in space as the scene itself, independent of
    all others, so that results are the same to the last bit in any order and on any process.  Failures are recorded
    with their reason.  Without an executor processes are started: a script has to call this below
    ``if __name__ == "__main__":``.

    Parameters
    ----------
    scene : Scene
        With any analysis; its expectations are ignored.
    cases : Cases or mapping
        Columns of numbers by name; see :func:`~sfetcas.grid`, :func:`~sfetcas.sampled`.
    quantities : sequence of str
        Quantities of each answer: ``nodes.tip.position``, ``members.beam.moment at 0.5``, ``reactions.A.force``,
        ``modes.omega``, ``factor limit_point 1``, ``nodes.tip.velocity time 0.5``.
    executor : Executor, optional
        Any with the interface of :mod:`concurrent.futures`, as ``Client(...).get_executor()`` of Dask or
        ``mpi4py.futures.MPIPoolExecutor()``; it is not shut down.  By default local processes.
    workers : int, optional
        Number of local processes, and of threads of a batch; by default that of processors.
    settings : Settings, optional
        As of :func:`~sfetcas.solve`.
    chunk : int, optional
        Number of cases that are submitted together.
    progress : callable, optional
        Called with the number of cases done since the last call, as ``tqdm.tqdm(total=len(cases)).update``.

    batch : bool
        Solve cases in which nothing out of the ordinary happens by the core, in threads of this process: on meshes
        that they share, the loads followed from zero, with error estimates as they are else.  All others, and those
        whose eigenvalues or errors come near to a limit, are solved as without.  There are no notes, such as that
        stretch which is left out would count.  For scenes of statics without
        contact, stops, histories and the like; positions differ by the accuracy from those without a batch.
    warm : bool
        In a batch, begin at the nearest case solved before where that leads to a stable equilibrium: two to three
        times faster, but where there are several stable ones the answer depends on the order of the cases.

    Returns
    -------
    Sweep
        Rows in the order of the cases; after KeyboardInterrupt with the results up to then.

    Raises
    ------
    SceneError
        The scene has no such numbers, its answers no such quantities, or anything else is not accepted.

    Examples
    --------
    >>> found = sweep(scene, {"loads.tip.value.1": [0, 5, 10]}, ["nodes.tip.position"])  # doctest: +SKIP
    >>> found.values("nodes.tip.position")  # doctest: +SKIP
    """
    check_scene(scene, "sweep({}, ...)")
    if executor is not None and (not isinstance(executor, Executor) or workers is not None):
        found = say(executor) if workers is None else "an executor and a number of workers"
        raise SceneError(
            f"found {found}, accepted: a concurrent.futures.Executor, or a number of workers", ("executor",)
        )
    if chunk is not None:
        chunk = whole(chunk, 1, what="number of cases", name="chunk")
    if workers is not None:
        workers = whole(workers, 1, MOST_WORKERS, what="number of processes", name="workers")
    if warm and not batch:
        raise SceneError("found True without a batch, accepted: warm = True with batch = True", ("warm",))
    single = cases_from(cases).single(scene)
    wanted = wanted_of(scene, quantities)
    _check_together(single, wanted)
    settings, progress = settings or Settings(), progress or _silent
    job = Job(_expecting(scene, wanted), settings, tuple(single.columns), wanted)
    values = np.column_stack(list(single.columns.values()))
    begin = time.perf_counter()
    plain = batch_of(scene, job.names, wanted, settings) if batch else None
    if plain is None:
        outcomes, interrupted = _fed(executor, workers, job, values.tolist(), chunk, progress)
        return gathered(scene, single, wanted, Outcomes.of(outcomes), time.perf_counter() - begin, interrupted)
    answers = plain.solve(values, warm=warm, threads=workers or cores(), progress=progress)
    left, interrupted = np.flatnonzero(~answers.known), answers.interrupted
    others = [Outcome(NOT_RUN, "interrupted before")] * len(left)
    if len(left) and not interrupted:
        others, interrupted = _fed(executor, workers, job, values[left].tolist(), chunk, progress)
    every = outcomes_of(plain, answers, dict(zip(left.tolist(), others, strict=True)))
    return gathered(scene, single, wanted, every, time.perf_counter() - begin, interrupted)


def _fed(
    executor: Executor | None,
    workers: int | None,
    job: Job,
    values: list[list[float]],
    chunk: int | None,
    progress: Callable[[int], object],
) -> tuple[list[Outcome], bool]:
    """Cases solved one by one, by an executor or by processes: their outcomes, and whether it was interrupted."""
    size = chunk or chunk_of(len(values))
    if executor is not None:
        return fed(executor, job, values, size, progress)
    with _own(workers, len(values)) as own:
        outcomes, interrupted = fed(own, job, values, size, progress)
        if interrupted:
            own.kill()
        return outcomes, interrupted


def _silent(more: int) -> None:
    """Told how far it is, by nobody."""


def _own(workers: int | None, count: int) -> Workers:
    return Workers(min(cores(), count) if workers is None else workers)


def _expecting(scene: Scene, wanted: Sequence[Wanted]) -> Scene:
    """The scene that expects just what is wanted: times of these are among the answers of a motion, as its own are."""
    own = [expect for expect in scene.expect if expect.time is not None]
    return scene.replace(expect=(*(one.expect for one in wanted), *own))


def _check_together(cases: Cases, wanted: Sequence[Wanted]) -> None:
    """Refuse quantities of a factor that the cases replace."""
    for one in wanted:
        if "factor" in cases.columns and one.expect.step is not None:
            message = "found 'step' where the cases say the factor, accepted: the quantity without it"
            raise SceneError(message, ("quantities", one.text))
