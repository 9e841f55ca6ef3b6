"""Cases from the words of a command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from ..description.scene import Scene
from ..errors import SceneError
from ..mathematics.arrays import Array
from .cases import MOST_CASES, Cases, grid, read_cases, sampled
from .distributions import Distribution, LogNormal, Normal, Uniform

__all__ = ["assigned", "cases_in_words", "usual_quantities"]

T = TypeVar("T")

NUMBER = r"\s*[+-]?(?:[\d_]+\.?[\d_]*|\.[\d_]+)(?:[eE][+-]?\d+)?\s*"

KINDS: dict[str, Callable[[float, float], Distribution]] = {
    "normal": Normal,
    "lognormal": LogNormal,
    "uniform": Uniform,
}


def cases_in_words(
    vary: Sequence[str],
    sample: Sequence[str],
    table: Path | None,
    count: int,
    seed: int,
    method: Literal["random", "latin"],
) -> Cases:
    """All combinations of what varies, or samples, or a table.

    Parameters
    ----------
    vary : sequence of str
        ``NAME=LOW:HIGH:COUNT`` or ``NAME=VALUE,VALUE,...``.
    sample : sequence of str
        ``NAME=normal:MEAN:DEVIATION``, ``lognormal:MEAN:DEVIATION`` or ``uniform:LOW:HIGH``.
    table : Path or None
        A CSV file.
    count, seed, method
        Of samples.

    Raises
    ------
    SceneError
        There is none or more than one of the three, or anything is not accepted.
    """
    if sum(map(bool, (vary, sample, table))) != 1:
        raise SceneError("found none or more than one of --vary, --sample and --cases, accepted: one of them")
    if table is not None:
        return read_cases(table)
    if vary:
        return grid(_named([_varied(text) for text in vary], "--vary"))
    return sampled(count, _named([_drawn(text) for text in sample], "--sample"), seed=seed, method=method)


def usual_quantities(scene: Scene) -> list[str]:
    """Quantities kept by default: frequencies of modes, else the positions of all nodes that can move."""
    if scene.analysis.type == "modes":
        return ["modes.omega"]
    free = [name for name, node in scene.nodes.items() if node.support == "free"]
    return [f"nodes.{name}.position" for name in free or scene.nodes]


def assigned(text: str) -> tuple[str, str]:
    """A name and what stands behind the last ``=`` that numbers follow, nothing where none do.

    Names of a scene may have this sign themselves.

    >>> assigned("loads.a=2.value.1=0:10:3"), assigned("loads.a=2.value")
    (('loads.a=2.value.1', '0:10:3'), ('loads.a=2.value', ''))
    """
    found = re.fullmatch(rf"(.+)=({NUMBER}(?:[:,]{NUMBER})*)", text, re.DOTALL)
    return (found[1], found[2]) if found else (text, "")


def _named(pairs: Sequence[tuple[str, T]], option: str) -> dict[str, T]:
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise SceneError(f"{option}: found {name} twice, accepted: each number once")
    return dict(pairs)


def _varied(text: str) -> tuple[str, Array]:
    name, values = assigned(text)
    parts = values.split(":")
    try:
        if len(parts) not in (1, 3):
            raise ValueError
        if len(parts) == 1:
            return name, np.array([float(value) for value in values.split(",")])
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except ValueError:
        raise SceneError(f"--vary: found {text!r}, accepted: NAME=LOW:HIGH:COUNT or NAME=VALUE,VALUE,...") from None
    if not 1 <= count <= MOST_CASES or (count > 1 and low == high):
        raise SceneError(f"--vary: found {text!r}, accepted: 1 to {MOST_CASES} values between two bounds that differ")
    return name, np.linspace(low, high, count)


def _drawn(text: str) -> tuple[str, Distribution]:
    name, _, words = text.rpartition("=")
    kind, *numbers = words.split(":")
    try:
        one, other = (float(number) for number in numbers)
        made = KINDS[kind] if name else None
    except (ValueError, KeyError):
        made = None
    if made is None:
        accepted = "NAME=normal:MEAN:DEVIATION, lognormal:MEAN:DEVIATION or uniform:LOW:HIGH"
        raise SceneError(f"--sample: found {text!r}, accepted: {accepted}") from None
    try:
        return name, made(one, other)
    except SceneError as error:
        raise error.within("--sample", name) from None
