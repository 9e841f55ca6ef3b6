"""The knob measured: what ``accuracy`` promises against what comes out; part of ``python -m benchmarks``.

All problems of statics, modes and paths in the folder ``problems`` of the working folder are solved to several
accuracies.  True errors are against the same equilibria on a quarter of the element lengths, in contact, of modes and
of paths against the finest answer; effectivity is estimated over true error.  For 1e-6 the time is compared with that
of the best mesh of equal elements.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sfetcas.description.scene import Scene
from sfetcas.description.scenefile import load
from sfetcas.errors import SceneError
from sfetcas.tradeoff.measuring import Measurement, measure
from sfetcas.tradeoff.tables import markdown_table
from sfetcas.tradeoff.variants import Variant, families

from .saving import head, row

__all__ = ["estimates", "knob", "problems_of"]

ASKED = {
    "static": (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
    "modes": (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8),
    "path": (1e-3, 1e-4, 1e-5, 1e-6),
}
"""Accuracies, by the type of the analysis."""

COMPARED = 1e-6
"""That at which times are compared with the best mesh."""

RIVALS = ("SFET3", "SFET5", "SFET7", "SFET9")
"""Elements of the meshes it is compared with."""

RUNS, LONGEST = 2, 1.0
"""Of each, and seconds that all may take."""

FINEST = {"static": 1e-11, "modes": 1e-11, "path": 1e-8}
"""Accuracies of what others are compared with."""

EXACT = {"static": 1e-13, "modes": 1e-10, "path": 3e-9}
"""Errors below this are rounding, or of what others are compared with: no estimate can be told right or wrong by them.
"""


def problems_of(kind: str) -> dict[str, Scene]:
    """Scenes with a type of analysis in the folder ``problems``, by their names.

    Raises
    ------
    SceneError
        There is no such folder.
    """
    files = sorted(Path("problems").glob("*.toml"))
    if not files:
        raise SceneError("problems: found no scenes here, accepted: a working folder that has the folder problems")
    scenes = {file.stem: load(file) for file in files}
    return {name: scene for name, scene in scenes.items() if scene.analysis.type == kind}


def knob() -> None:
    """Effectivity, share of answers that keep what was asked for, and time against the best mesh by hand."""
    scenes, references = _kept("static")
    _against_the_best(scenes, references, NAMES["static"])


def estimates() -> None:
    """Effectivity, share of answers that keep what was asked for, and time against the best mesh by hand, of modes and
    of paths.
    """
    found = {}
    for kind in ("modes", "path"):
        found[kind] = _kept(kind)
        print()
    for kind, (scenes, references) in found.items():
        _against_the_best(scenes, references, NAMES[kind])


NAMES = {"static": "statics", "modes": "modes", "path": "paths"}


def _kept(kind: str) -> tuple[dict[str, Scene], dict[str, Measurement]]:
    """Print how the accuracy is kept; the problems, and what they were compared with."""
    print(f"Accuracy asked for and kept, over all problems of {NAMES[kind]}; effectivity: estimated over true error\n")
    scenes, accuracies = problems_of(kind), ASKED[kind]
    found = {
        name: {asked: measure(scene, Variant(accuracy=asked), 0) for asked in accuracies}
        for name, scene in scenes.items()
    }
    references = {name: measure(scene, Variant(accuracy=FINEST[kind]), 0) for name, scene in scenes.items()}
    rows: list[tuple[str, ...]] = []
    for asked in accuracies:
        errors = {name: _error(runs[asked], references[name]) for name, runs in found.items()}
        effects = [
            float(run.estimate) / errors[name]
            for name, run in ((name, runs[asked]) for name, runs in found.items())
            if run.estimate and EXACT[kind] < errors[name] < np.inf
        ]
        kept = sum(error <= asked for error in errors.values())
        worst = max(errors, key=lambda name: errors[name])
        low, middle, high = np.quantile(effects, [0.05, 0.5, 0.95]) if effects else 3 * [np.nan]
        rows.append(
            (
                f"{asked:.0e}",
                f"{kept} of {len(errors)}",
                f"{errors[worst] / asked:.2g} ({worst})",
                f"{min(effects, default=np.nan):.2g}",
                f"{low:.2g}",
                f"{middle:.2g}",
                f"{high:.2g}",
            )
        )
    heads = ("accuracy", "kept", "largest error over it", "effectivity, least", "5 %", "median", "95 %")
    print("\n".join(markdown_table(heads, rows)))
    return scenes, references


def _error(run: Measurement, reference: Measurement) -> float:
    """True error of a run; infinite without an answer."""
    if run.own_error is not None:
        return run.own_error
    if run.observation is None or reference.observation is None:
        return np.inf
    return run.observation.error(reference.observation)


def _against_the_best(scenes: dict[str, Scene], references: dict[str, Measurement], what: str) -> None:
    print(f"\nA whole run of {what}, accuracy = {COMPARED:g}, against the best mesh of equal elements; milliseconds\n")
    head("problem", "whole run", "best mesh", "ratio", "that mesh")
    ratios = {}
    for name, scene in scenes.items():
        asked = measure(scene, Variant(accuracy=COMPARED), RUNS, LONGEST)
        best: Measurement | None = None
        for family in families(scene):
            if family[0].element not in RIVALS or family[0].integration != "nodes":
                continue
            for variant in family:
                run = measure(scene, variant, RUNS, LONGEST)
                if run.failure:
                    continue
                if best is not None and run.seconds > 1.5 * best.seconds:
                    # Finer ones take longer.
                    break
                if _error(run, references[name]) <= COMPARED:
                    best = run if best is None or run.seconds < best.seconds else best
                    break
        if best is None:
            row(name, f"{1e3 * asked.seconds:.1f}", "-", "-", "none is as near")
            continue
        ratios[name] = asked.seconds / best.seconds
        row(name, f"{1e3 * asked.seconds:.1f}", f"{1e3 * best.seconds:.1f}", f"{ratios[name]:.2f}", best.variant.name)
    known = np.array(list(ratios.values()))
    if len(known):
        within = int((known <= 1.5).sum())
        print(f"\nmedian {np.median(known):.2f}, largest {known.max():.2f}, at most 1.5 in {within} of {len(known)}")
