"""What a scene may ask for where laws of sections have memory: analyses in which each step comes after another."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import SceneError

__all__ = ["check_memory", "refuse_memory", "remembering_section"]

TYPES = ("static", "path", "dynamic")
TYPES_IN_WORDS = ", ".join(map(repr, TYPES[:-1])) + f" or {TYPES[-1]!r}"
"""Types of the analysis whose steps come one after the other."""

TURNS = 1e-6
"""Share of the largest factor of a history by which it may go back between two steps: rounding of smooth ones."""

SAMPLES = 65
"""Places between two steps at which a history is looked at, beside its knots."""

INTEGRATORS = ("radau-3", "radau-2", "generalised-alpha")
"""Those whose stages know what is remembered."""


def remembering_section(scene: Any) -> str:
    """Name of the first section in use whose law has memory; empty where there is none."""
    used = (member.section for member in scene.members.values() if member.remembers(scene.sections))
    return next(used, "")


def refuse_memory(scene: Any, message: str) -> None:
    """Refuse a scene in which the law of a section has memory.

    Raises
    ------
    SceneError
        Names the law, with the message.
    """
    section = remembering_section(scene)
    if section:
        law = scene.sections[section].law.type
        raise SceneError(
            f"found {law!r}, whose moments depend on the steps before: {message}", ("sections", section, "law")
        )


def check_memory(scene: Any) -> None:
    """Refuse analyses in which no step comes after another, and what is not tried together with memory.

    Raises
    ------
    SceneError
        Names the key.
    """
    section = remembering_section(scene)
    if not section:
        return
    analysis, law = scene.analysis, scene.sections[section].law.type
    whose = f"of section {section!r}, whose moments depend on the steps before"
    if analysis.type not in TYPES:
        message = f"found {analysis.type!r}, accepted: {TYPES_IN_WORDS} with the law {law!r} {whose}"
        raise SceneError(message, ("analysis", "type"))
    if analysis.equilibria == "all":
        message = f"found 'all', accepted: 'one' with the law {law!r} {whose}"
        raise SceneError(message, ("analysis", "equilibria"))
    beside = "accepted: none beside a law with memory"
    if scene.rotating is not None:
        raise SceneError(f"found rotating axes, {beside}", ("rotating",))
    if scene.contacts:
        raise SceneError(f"found {next(iter(scene.contacts))!r}, {beside}", ("contacts",))
    for name, spring in scene.springs.items():
        if spring.stop is not None:
            raise SceneError(f"found a stop, {beside}", ("springs", name, "stop"))
    for name, tendon in scene.tendons.items():
        if tendon.may_be_slack:
            message = "found one that may be slack, accepted: one of a given tension beside a law with memory"
            raise SceneError(message, ("tendons", name))
    if analysis.type == "dynamic":
        _check_motion(analysis, law)
    elif analysis.type == "path":
        _check_path(scene, law)
    else:
        _check_steps(scene, law)


def _check_motion(analysis: Any, law: str) -> None:
    if analysis.integrator not in (None, *INTEGRATORS):
        accepted = ", ".join(INTEGRATORS[:-1]) + " or " + INTEGRATORS[-1]
        message = f"found {analysis.integrator!r}, accepted: {accepted} with the law {law!r}, which has memory"
        raise SceneError(message, ("analysis", "integrator"))
    if analysis.initial != "undeformed":
        message = f"found {analysis.initial!r}, accepted: 'undeformed' with the law {law!r}, which has memory"
        raise SceneError(message, ("analysis", "initial"))


def _check_path(scene: Any, law: str) -> None:
    analysis = scene.analysis
    if any(m.remembers(scene.sections) and m.stretches(scene.sections) for m in scene.members.values()):
        message = f"found 'path' with the law {law!r}, which has memory, of a section that stretches or shears"
        raise SceneError(f"{message}, accepted: 'static' or 'dynamic'", ("analysis", "type"))
    if analysis.branches:
        message = f"found {analysis.branches}, accepted: 0 with the law {law!r}, which has memory"
        raise SceneError(f"{message}: a path goes on from what led to it", ("analysis", "branches"))
    if analysis.count_of_modes:
        message = f"found {analysis.count_of_modes}, accepted: none on a path with the law {law!r}, which has memory"
        raise SceneError(message, ("analysis", "modes"))


def _check_steps(scene: Any, law: str) -> None:
    """Refuse steps that are no way from one to the next: equal ones, and histories that turn between two of them."""
    steps, where = scene.analysis.steps, ("analysis", "steps")
    again = [factor for i, factor in enumerate(steps) if factor in steps[:i]]
    if again:
        message = f"found {again[0]:g} twice, accepted: each once with the law {law!r}, which has memory"
        raise SceneError(f"{message}; a history takes loads to and fro over rising factors", where)
    for name in sorted(scene.histories_used):
        history = scene.histories[name]
        knots = np.array(history.knots)
        # Before the first step nothing acts.
        before = [0.0]
        for begin, end in pairwise((0.0, *steps)):
            low, high = min(begin, end), max(begin, end)
            t = np.unique([*np.linspace(low, high, SAMPLES), *knots[(low < knots) & (knots < high)]])
            values = np.concatenate([before, history.factor(t if begin <= end else t[::-1])])
            before = []
            rates = np.diff(values)
            back = min(rates[rates > 0.0].sum(), -rates[rates < 0.0].sum())
            if back > TURNS * np.abs(values).max():
                message = (
                    f"found none between {begin:g} and {end:g}, where the history {name!r} turns, accepted: a step"
                )
                raise SceneError(f"{message} where it does, as the law {law!r} has memory", where)
