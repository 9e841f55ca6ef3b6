"""One way to solve a scene, run and timed; meant for a process of its own, whose caches are cold and memory its own."""

from __future__ import annotations

import contextlib
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, cast

import numpy as np

from ..analyses import solve
from ..description.scene import Scene
from ..equilibria.quantities import Quantity
from ..equilibria.single import solve_model, unjudged
from ..equilibria.solution import Equilibrium, Solution
from ..errors import SceneError, SolveError
from ..mathematics.core import without_core
from ..mechanics.fields import transferred
from ..mechanics.model import assemble
from ..solvers.prepared import Prepared
from .observed import Observation, expected_error, observe, refinable
from .variants import Variant

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

__all__ = ["Measurement", "Timing", "measure", "peak_memory"]

T = TypeVar("T")

Assembly = Literal["auto", "closing", "nodal"]

OF_TWO_MESHES = 1e-3
"""Positions nearer than this share of the size are those of the same equilibrium on two meshes."""


@dataclass(frozen=True)
class Timing:
    """Seconds of repeated runs.

    Attributes
    ----------
    median, low, high : float
        Of these the quartiles.
    runs : int
    """

    median: float
    low: float
    high: float
    runs: int

    @classmethod
    def of(cls, seconds: list[float]) -> Timing:
        """Of single runs."""
        low, high = np.quantile(seconds, [0.25, 0.75])
        return cls(statistics.median(seconds), float(low), float(high), len(seconds))


@dataclass(frozen=True)
class Measurement:
    """What one way to solve a scene costs, and what comes out.

    Attributes
    ----------
    variant : Variant
    failure : str
        Why there is no answer; what follows is then as it was set.
    refused : bool
        The scene asks for what cannot be modelled.
    first : float
        Seconds of the first run in a process that has sfetcas loaded and nothing else done: element functions are
        derived, and compiled where that pays.
    whole : Timing or None
        Of further whole runs: model, start, branch, estimate of the error.
    model, solve : float
        Share of the last of them in models and in solving, s.
    again : Timing or None
        Of repeated solves of one prepared model at the last factor from the start guess, on the mesh of the answer:
        statics without contact and stops.
    memory : float or None
        By how much the first run made the process grow, MB.
    elements, unknowns, iterations, steps : int
        Iterations are those of IPOPT, steps those in time; zero where there are none.
    status : str
    estimate : float or None
        The answer's own.
    observation : Observation or None
    own_error : float or None
        Of statics against the same equilibrium on a quarter of the element lengths.
    expected : tuple or None
        See :func:`~sfetcas.tradeoff.observed.expected_error`.
    dimension : str
    """

    variant: Variant
    failure: str = ""
    refused: bool = False
    first: float = np.nan
    whole: Timing | None = None
    model: float = np.nan
    solve: float = np.nan
    again: Timing | None = None
    memory: float | None = None
    elements: int = 0
    unknowns: int = 0
    iterations: int = 0
    steps: int = 0
    status: str = ""
    estimate: float | None = None
    observation: Observation | None = field(default=None, repr=False)
    own_error: float | None = None
    expected: tuple[float, int, int] | None = None
    dimension: str = ""

    @property
    def seconds(self) -> float:
        """Of a whole run, once everything is loaded; that of the first where there was no other."""
        return self.first if self.whole is None else self.whole.median


def peak_memory() -> float | None:
    """Largest memory of this process so far, MB; None where the system does not report it."""
    if resource is None:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) / (1e6 if sys.platform == "darwin" else 1e3)


def measure(scene: Scene, variant: Variant, repeats: int = 5, longest: float = 2.0) -> Measurement:
    """Run a variant: once cold, then ``repeats`` times, or until ``longest`` seconds have passed.

    Errors, as of a scene without solution, are recorded in ``failure``.
    """
    try:
        with contextlib.nullcontext() if variant.core else without_core():
            return _measured(scene, variant, repeats, longest)
    except (SceneError, SolveError) as error:
        return Measurement(variant, failure=str(error), refused=isinstance(error, SceneError))
    except (FloatingPointError, OverflowError, np.linalg.LinAlgError, MemoryError) as error:
        return Measurement(variant, failure=f"the numbers leave what can be computed ({type(error).__name__})")


def _measured(scene: Scene, variant: Variant, repeats: int, longest: float) -> Measurement:
    asked, settings, before = variant.scene(scene), variant.settings(), peak_memory()
    begin = time.perf_counter()
    answer = solve(asked, settings)
    first = time.perf_counter() - begin
    after = peak_memory()
    whole, answer = _repeated(lambda: solve(asked, settings), answer, repeats, longest, first)
    last = answer.last
    name = settings.accuracy_of or scene.analysis.accuracy_of
    quantity = Quantity.named(name, scene) if name else None
    single = refinable(asked, answer)
    return Measurement(
        variant,
        first=first,
        whole=whole,
        model=answer.seconds["model"],
        solve=answer.seconds["solve"],
        again=_again(last, variant, repeats, longest) if single and isinstance(last, Equilibrium) else None,
        memory=None if before is None or after is None else after - before,
        elements=last.model.mesh.elements,
        unknowns=last.model.unknowns,
        iterations=sum(step.iterations for step in answer.steps if isinstance(step, Equilibrium)),
        steps=getattr(answer, "count", 0),
        status=answer.status.name,
        estimate=_estimate(answer),
        observation=observe(asked, answer, quantity),
        own_error=_own_error(asked, answer, quantity) if single and isinstance(answer, Solution) else None,
        expected=expected_error(asked, answer),
        dimension=last.model.dimension,
    )


def _estimate(answer: Any) -> float | None:
    if isinstance(answer, Solution):
        return max((step.certificate.error_estimate or 0.0 for step in answer.steps), default=None)
    estimate = answer.error_estimate
    return None if estimate is None else float(estimate)


def _repeated(
    run: Callable[[], T], result: T, repeats: int, longest: float, expected: float
) -> tuple[Timing | None, T]:
    """Timing of so many runs and the last result; none where one is expected to take longer than all may."""
    seconds: list[float] = []
    while len(seconds) < repeats and sum(seconds) + expected < longest:
        begin = time.perf_counter()
        result = run()
        seconds.append(time.perf_counter() - begin)
        expected = seconds[-1]
    return (Timing.of(seconds) if seconds else None), result


def _again(last: Equilibrium, variant: Variant, repeats: int, longest: float) -> Timing | None:
    """Repeated solves of one prepared model; None where the start guess leads to another equilibrium, or to none."""
    prepared = Prepared(last.model, kernels=variant.kernels, evaluations=1e3)
    begin = time.perf_counter()
    try:
        found = solve_model(prepared, last.factor, solver=variant.solver)
    except (SceneError, SolveError):
        return None
    if prepared.distance(found.state, last.state) > OF_TWO_MESHES:
        return None
    expected = time.perf_counter() - begin
    solved = _repeated(
        lambda: solve_model(prepared, last.factor, solver=variant.solver), found, 3 * repeats, 0.5 * longest, expected
    )
    return solved[0]


def _own_error(scene: Scene, answer: Solution, quantity: Quantity | None) -> float | None:
    """Error against the same equilibria on meshes with a quarter of the element lengths."""
    fine: list[Equilibrium] = []
    for step in answer.steps:
        mesh, assembly = step.model.mesh.refined().refined(), cast(Assembly, step.model.assembly)
        prepared = Prepared(assemble(scene, mesh, assembly=assembly))
        state = transferred(step.model, step.state, prepared.model)
        found = prepared.correct(state, prepared.model.loading(step.factor), iterations=40)
        if not found.converged:
            return None
        fine.append(unjudged(found))
    reference = Solution(scene, answer.status, tuple(fine), answer.seconds)
    return observe(scene, answer, quantity).error(observe(scene, reference, quantity))
