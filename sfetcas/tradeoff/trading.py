"""Accuracy against time of one scene: which discretisation gives which error for which time, and what to take.

1. A *reference*: the scene solved as finely as the library does, with its own estimate; or what the file expects.
2. What the library chooses by itself, over the accuracy asked for.
3. Families of meshes, from coarse to fine, until they gain nothing.
4. Of the cheapest ones for errors of 1e-3, 1e-6 and 1e-9 the other ways: assembly, solver, kernels, without the
   core, space for plane.

Each run has a process of its own: the first run is a first run, and memory is its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..analyses import solve
from ..description.scene import Scene
from ..equilibria.solution import Solution
from ..errors import SceneError, SolveError, Status
from .machine import machine
from .measuring import Measurement, measure
from .observed import Observation
from .peers import Peer, run_peer
from .running import Apart, EndedError
from .variants import Variant, by_accuracy, families, other_ways

__all__ = ["TARGETS", "Limits", "Row", "Trade", "again", "trade", "whole", "with_peer"]

TARGETS = (1e-3, 1e-6, 1e-9)
"""Errors for which advice is given."""

FINEST = {
    "static": (1e-12, 1e-11, 1e-10, 1e-8, 1e-6, 1e-4),
    "path": (1e-10, 1e-8, 1e-6, 1e-4),
    "modes": (1e-11, 1e-9, 1e-7, 1e-5),
    "dynamic": (1e-6, 1e-5, 1e-4, 1e-3, 1e-2),
}
"""Accuracies of the reference, the first that can be had."""

NOTHING_TO_GAIN = 1e-13
"""Errors below this share are rounding: a family has nothing to gain."""

ELSEWHERE = 0.02
"""An error above this, that halving the elements twice does not confirm, is that of another equilibrium."""

LITTLE = 1.25
"""Settings whose times differ by less than this are as good as each other: no machine measures better."""

GAINED = 0.7
"""A finer mesh gains something where it leaves less than this share of the error."""

STALLED = 2
"""Meshes of a family in a row that gain nothing."""


@dataclass(frozen=True)
class Limits:
    """Limits of a measurement.

    Attributes
    ----------
    repeats : int
        Number of whole runs of each variant after the first; solves alone are repeated three times as often.
    longest : float
        Time, s, of a run that ends its family of variants.
    budget : float
        Time, s, of all runs; variants that are left out then are reported.
    """

    repeats: int = 5
    longest: float = 10.0
    budget: float = 300.0

    def __post_init__(self) -> None:
        if not 0 <= self.repeats <= 1000:
            raise SceneError(f"repeats: found {self.repeats}, accepted: 0 to 1000")
        for name in ("longest", "budget"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise SceneError(f"{name}: found {getattr(self, name):g}, accepted: seconds above zero")


@dataclass(frozen=True)
class Row:
    """A measurement with its error.

    Attributes
    ----------
    measurement : Measurement
    error : float
        Against the reference; infinite without an answer and at another equilibrium.
    remark : str
        ``mirrored``: symmetric to the reference; ``another equilibrium``; why there is no answer.
    """

    measurement: Measurement
    error: float
    remark: str = ""

    @property
    def name(self) -> str:
        """That of the variant."""
        return self.measurement.variant.name

    @property
    def seconds(self) -> float:
        """Of a whole run."""
        return self.measurement.seconds

    @property
    def again(self) -> float:
        """Of a repeated solve alone; infinite where there is none."""
        return np.inf if self.measurement.again is None else self.measurement.again.median


@dataclass(frozen=True)
class Trade:
    """What was measured.

    Attributes
    ----------
    scene : Scene
    kind : str
        What errors are of.
    reference : Measurement
    against : str
        ``refined`` or ``file``.
    rows : tuple of Row
    peers : tuple of Peer
    machine : dict
    notes : tuple of str
    """

    scene: Scene = field(repr=False)
    kind: str
    reference: Measurement
    against: str
    rows: tuple[Row, ...] = field(repr=False)
    machine: dict[str, str]
    notes: tuple[str, ...] = ()
    peers: tuple[Peer, ...] = ()

    def front(self, cost: Callable[[Row], float]) -> list[Row]:
        """Rows of which none is both better and cheaper, the cheapest first."""
        best, found = np.inf, []
        for row in sorted(self.rows, key=lambda row: (cost(row), row.error)):
            if row.error < best and np.isfinite(cost(row)):
                found.append(row)
                best = row.error
        return found

    def cheapest(self, error: float, cost: Callable[[Row], float], *, chosen: bool | None = None) -> Row | None:
        """The cheapest row with at most such an error; of what the library chose, of the others, or of all."""
        fits = [
            row
            for row in self.rows
            if row.error <= error
            and np.isfinite(cost(row))
            and (chosen is None or row.measurement.variant.chosen == chosen)
        ]
        return min(fits, key=cost, default=None)

    def asked(self, accuracy: float) -> Row | None:
        """The row where the library was asked for an accuracy."""
        return next((row for row in self.rows if row.measurement.variant.accuracy == accuracy), None)

    @property
    def advice(self) -> str:
        """Which setting for 1e-3, 1e-6 and 1e-9, in one sentence."""
        return "; ".join(self._advised(target) for target in TARGETS) + "."

    def _advised(self, target: float) -> str:
        """For one error: the accuracy itself where that costs little more than the best mesh by hand, else that."""
        best, asked = self.cheapest(target, whole, chosen=False), self.asked(target)
        kept = asked is not None and asked.error <= target
        if kept and asked is not None and (best is None or asked.seconds <= LITTLE * best.seconds):
            best = asked
        if best is None:
            return f"{target:.0e} was not reached"
        sentence = f"for {target:.0e} take {best.name} ({_time(best.seconds)}"
        repeated = self.cheapest(target, again, chosen=False)
        if repeated is not None and repeated.again < best.again / LITTLE:
            return f"{sentence}), to solve again and again {repeated.name} ({_time(repeated.again)})"
        return f"{sentence}, solved again {_time(best.again)})" if np.isfinite(best.again) else f"{sentence})"

    def verdict(self, accuracy: float) -> str:
        """What asking for an accuracy gives, against the best mesh by hand; empty where it was not run."""
        row, best = self.asked(accuracy), self.cheapest(accuracy, whole, chosen=False)
        if row is None:
            return ""
        if not np.isfinite(row.error):
            return f"accuracy = {accuracy:.0e}: {row.remark}"
        sentence = f"accuracy = {accuracy:.0e}: error {row.error:.1e} in {_time(row.seconds)}"
        return sentence if best is None else f"{sentence}, {row.seconds / best.seconds:.1f} times the best mesh by hand"


def whole(row: Row) -> float:
    """Seconds of a whole run."""
    return row.seconds


def again(row: Row) -> float:
    """Seconds of a repeated solve alone."""
    return row.again


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def trade(
    scene: Scene,
    *,
    limits: Limits | None = None,
    against: Literal["refined", "file"] = "refined",
    progress: Callable[[str], object] | None = None,
) -> Trade:
    """Measure accuracy against time for the discretisations of a scene.

    Processes are started: a script has to call this below ``if __name__ == "__main__":``.

    Parameters
    ----------
    limits : Limits, optional
    against : str
        Reference of the errors: a ``refined`` solution, or the expected values of the ``file``.
    progress : callable, optional
        Called with the name of each variant before it is run.

    Raises
    ------
    SceneError
        The scene asks for what cannot be modelled.
    SolveError
        No reference could be had.
    """
    return _Trading(scene, limits or Limits(), against, progress or (lambda name: None)).trade()


def with_peer(found: Trade, command: str, file: Path, longest: float) -> Trade:
    """A trade with another program beside it, whose answers of statics are compared with the reference.

    Parameters
    ----------
    command : str
        See :mod:`~sfetcas.tradeoff.peers`.
    file : Path
        The scene file.
    longest : float
        Seconds that it may take.

    Raises
    ------
    SceneError
        It cannot be run, fails, or prints something else; or the scene asks for something else than statics.
    """
    if found.scene.analysis.type != "static":
        raise SceneError(f"--peer: found type {found.scene.analysis.type!r}, accepted: 'static'")
    reference = solve(found.reference.variant.scene(found.scene), found.reference.variant.settings())
    assert isinstance(reference, Solution)
    return replace(found, peers=(*found.peers, *run_peer(command, file, reference, longest)))


@dataclass
class _Family:
    """What is left of a family, its least error, and how many of its last members gained nothing."""

    members: Iterator[Variant]
    best: float = np.inf
    stalled: int = 0


class _Trading:
    """The runs of one trade."""

    def __init__(
        self, scene: Scene, limits: Limits, against: Literal["refined", "file"], progress: Callable[[str], object]
    ) -> None:
        self.scene, self.limits, self.against, self.progress = scene, limits, against, progress
        self.apart = Apart()
        self.begin = time.perf_counter()
        self.rows: list[Row] = []
        self.left_out = 0

    def trade(self) -> Trade:
        """All runs."""
        self.reference = self._reference()
        assert self.reference.observation is not None
        self.observed: Observation = self.reference.observation
        for variant in by_accuracy(self.scene):
            if not self._run(variant):
                break
        self._families()
        self._other_ways()
        return Trade(
            self.scene,
            self.observed.kind,
            self.reference,
            self.against,
            tuple(self.rows),
            machine(),
            tuple(self._notes()),
        )

    @property
    def spent(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self.begin

    def _reference(self) -> Measurement:
        """The finest answer that can be had.

        Raises
        ------
        SceneError
            The scene asks for what cannot be modelled.
        SolveError
            None could.
        """
        failure = ""
        for accuracy in FINEST[self.scene.analysis.type]:
            variant = Variant(accuracy=accuracy)
            self.progress(f"reference, {variant.name}")
            try:
                found: Measurement = self.apart(
                    max(3.0 * self.limits.longest, 0.3 * self.limits.budget), measure, self.scene, variant, 0, 0.0
                )
            except EndedError as error:
                failure = failure or str(error)
                continue
            if found.observation is not None:
                return found
            if found.refused:
                raise SceneError(found.failure)
            failure = failure or found.failure
        raise SolveError(Status.FAILED, f"no reference could be had: {failure}")

    def _families(self) -> None:
        """The families side by side, their coarsest members first, so that a short budget is a coarse look at all."""
        alive = [_Family(iter(family)) for family in families(self.scene)]
        while alive:
            alive = [family for family in alive if self._goes_on(family)]

    def _goes_on(self, family: _Family) -> bool:
        """Run the next member of a family; whether there may be a finer one."""
        variant = next(family.members, None)
        if variant is None or not self._run(variant):
            return False
        row = self.rows[-1]
        # Meshes that are too coarse for the branch are seldom the last ones.
        gained = row.error < GAINED * family.best or not np.isfinite(row.error)
        family.best = min(family.best, row.error)
        family.stalled = 0 if gained else family.stalled + 1
        return row.error > max(NOTHING_TO_GAIN, self._floor) and family.stalled < STALLED

    @property
    def _floor(self) -> float:
        """Below this errors are those of the reference."""
        return (self.reference.estimate or 0.0) if self.against == "refined" else 0.0

    def _other_ways(self) -> None:
        rows = list(self.rows)
        bases: dict[Variant, None] = {}
        for target in TARGETS:
            fits = [row for row in rows if row.error <= target and not row.measurement.variant.chosen]
            for best in (min(fits, key=whole, default=None), min(fits, key=again, default=None)):
                if best is not None:
                    bases[best.measurement.variant] = None
        for base in bases:
            for variant in other_ways(self.scene, base, self.reference.dimension):
                self._run(variant)

    def _run(self, variant: Variant) -> bool:
        """Measure a variant; whether finer ones of its family may be run."""
        if self.spent > self.limits.budget:
            self.left_out += 1
            return False
        self.progress(variant.name)
        try:
            found: Measurement = self.apart(
                self.limits.longest, measure, self.scene, variant, self.limits.repeats, 0.5 * self.limits.longest
            )
        except EndedError as error:
            self.rows.append(Row(Measurement(variant, failure=str(error)), np.inf, str(error)))
            return False
        row = self._judged(found)
        self.rows.append(row)
        # What is refused once is refused on every mesh; what fails on a coarse mesh may not on a finer one.
        return not found.failure or found.variant.chosen or self.scene.analysis.type == "dynamic"

    def _judged(self, found: Measurement) -> Row:
        """A measurement with its error."""
        if found.observation is None:
            return Row(found, np.inf, found.failure)
        if self.against == "file":
            return Row(found, np.inf if found.expected is None else found.expected[0])
        error = found.observation.error(self.observed)
        own = found.own_error
        if error > ELSEWHERE and own is not None and own < 0.1 * error:
            if found.observation.mirrors(self.observed):
                return Row(replace(found, again=None), own, "mirrored")
            return Row(found, np.inf, "another equilibrium")
        return Row(found, error)

    def _notes(self) -> list[str]:
        notes = []
        if self.reference.expected is not None:
            worst, met, count = self.reference.expected
            sentence = f"the reference meets {met} of {count} expectations of the file"
            notes.append(f"{sentence}; largest relative difference {worst:.1e}")
        if self.left_out:
            notes.append(f"after {self.limits.budget:g} s {self.left_out} families or variants were left out")
        elsewhere = sum(row.remark == "another equilibrium" for row in self.rows)
        if elsewhere:
            notes.append(f"{elsewhere} settings led to another equilibrium, without an error that could be told")
        return notes
