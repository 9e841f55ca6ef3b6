"""What is compared of two answers of one scene: positions, or what the accuracy is of; factors; frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..checks import Answer, check
from ..description.answers import answer_name
from ..description.scene import Scene
from ..dynamics.modes import Modes
from ..dynamics.motion import Trajectory
from ..equilibria.quantities import Quantity
from ..equilibria.solution import Configuration, Equilibrium, Solution
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..paths.path import Path

__all__ = ["Observation", "expected_error", "observe", "refinable"]

PLACES = 0.5 - 0.5 * np.cos(np.pi * np.sqrt(0.5) * np.arange(64))
"""Fractions of a member at which positions are compared: denser at its ends, and none an end or middle of an element,
where errors are smaller than between."""

MANY = 40
"""Of scenes with more members only the nodes are."""

ENERGY = 1e-3
"""Equilibria whose energies differ by less than this share, and whose positions do by more, are mirror images."""


@dataclass(frozen=True)
class Observation:
    """Numbers of an answer, each row with the unit that differences are relative to.

    Attributes
    ----------
    kind : str
        What they are, in words.
    rows : tuple of ndarray
        One for each step, time or point.
    units : tuple of float
    keys : tuple
        Rows of the same key may stand in any order: equilibria of one factor.
    energies : tuple of float
        Of equilibria, to tell mirror images; else empty.
    """

    kind: str
    rows: tuple[Array, ...]
    units: tuple[float, ...]
    keys: tuple[object, ...]
    energies: tuple[float, ...] = ()

    def error(self, reference: Observation) -> float:
        """Largest difference from a reference; infinite where it has rows that the reference has not."""
        if not reference.rows or len(self.rows) != len(reference.rows):
            return np.inf
        return max(self._row_error(i, reference) for i in range(len(self.rows)))

    def _row_error(self, i: int, reference: Observation) -> float:
        rivals = [j for j, key in enumerate(reference.keys) if key == self.keys[i]]
        own = self.rows[i]
        errors = [
            float(np.abs(own - reference.rows[j]).max(initial=0.0)) / reference.units[j]
            for j in rivals
            if own.shape == reference.rows[j].shape
        ]
        return min(errors, default=np.inf)

    def mirrors(self, reference: Observation) -> bool:
        """Whether energies are those of the reference: of two answers that are far apart, mirror images."""
        if not self.energies or self.keys != reference.keys or len(self.energies) != len(reference.energies):
            return False
        a, b = np.array(self.energies), np.array(reference.energies)
        return bool((np.abs(a - b) <= ENERGY * np.abs(b)).all())


def observe(scene: Scene, answer: Answer, quantity: Quantity | None = None) -> Observation:
    """What is compared of an answer.

    Parameters
    ----------
    quantity : Quantity, optional
        Of statics and motions instead of the positions.

    Raises
    ------
    SceneError
        There is nothing to compare.
    """
    if isinstance(answer, Modes):
        omega = np.asarray(answer.omega, dtype=float)
        rows = tuple(np.array([value]) for value in omega)
        return Observation("frequencies", rows, tuple(np.abs(omega).tolist()), tuple(range(len(omega))))
    if isinstance(answer, Path):
        return _of_path(answer)
    kind = "positions" if quantity is None else quantity.text
    rows = tuple(_numbers(step, quantity) for step in answer.steps)
    if isinstance(answer, Trajectory):
        keys: tuple[object, ...] = tuple(range(len(rows)))
        unit = scene.size if quantity is None else quantity.unit(answer.last, rows)
        return Observation(kind, rows, (unit,) * len(rows), keys)
    units = [scene.size if quantity is None else quantity.unit(s, [r]) for s, r in zip(answer.steps, rows, strict=True)]
    energies = tuple(step.energy["elastic"] for step in answer.steps)
    return Observation(kind, rows, tuple(units), tuple(step.factor for step in answer.steps), energies)


def _numbers(step: Configuration, quantity: Quantity | None) -> Array:
    if quantity is not None:
        return quantity.value(step)
    return np.concatenate(list(_positions(step)))


def _positions(step: Configuration) -> Iterator[Array]:
    """Positions of nodes and along members, m, flat."""
    for node in step.model.nodes:
        yield step.position(node)
    members = step.model.scene.members
    for name in members if len(members) <= MANY else ():
        yield step.along(name, PLACES)["position"].ravel()


def _of_path(path: Path) -> Observation:
    """Factors of critical points, and positions where factors of ``steps`` are crossed."""
    rows: list[Array] = []
    units: list[float] = []
    keys: list[object] = []
    critical: dict[str, Sequence[Equilibrium]] = {
        "limit point": path.limit_points,
        "bifurcation": path.bifurcations,
        "flutter point": path.flutter_points,
        "transition": path.transitions,
    }
    for kind, points in critical.items():
        for i, point in enumerate(points):
            rows.append(np.array([point.factor]))
            units.append(abs(point.factor) or 1.0)
            keys.append((kind, i))
    asked = "steps" in path.scene.analysis.model_fields_set
    for i, step in enumerate(path.steps if asked else ()):
        rows.append(np.concatenate(list(_positions(step))))
        units.append(path.scene.size)
        keys.append(("crossing", i))
    if not rows:
        message = "found a path without critical points, accepted: one with such, or with 'steps' whose crossings count"
        raise SceneError(message, ("analysis", "steps"))
    return Observation("factors and crossings", tuple(rows), tuple(units), tuple(keys))


def expected_error(scene: Scene, answer: Answer) -> tuple[float, int, int] | None:
    """Against what the file expects: largest relative difference, how many expectations are met, and of how many.

    Positions count over the size of the scene, all else over itself; only numbers count.  None without any.
    """
    wanted = scene.replace(expect=[e for e in scene.expect if e.tolerance is not None])
    if not wanted.expect:
        return None
    worst, met = 0.0, 0
    for found in check(wanted, answer):
        key = answer_name(found.expect.quantity).kind.key
        size = float(np.abs(np.asarray(found.expect.value, dtype=float)).max())
        unit = {"position": scene.size, "quaternion": 1.0, "angle": 1.0}.get(key, size or 1.0)
        worst = max(worst, found.error / unit)
        met += found.passed
    return worst, met, len(wanted.expect)


def refinable(scene: Scene, answer: Answer) -> bool:
    """Whether an answer can be refined by itself, so that its error does not depend on which of several it is."""
    return isinstance(answer, Solution) and not scene.contacts and not scene.stopped
