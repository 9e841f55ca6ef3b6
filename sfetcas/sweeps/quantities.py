"""What is kept of each answer of a sweep: quantities by their names, as numbers.

Names are those of the answer, ``nodes.tip.position``; along members with a place, ``members.beam.moment at 0.5``; of
one of several answers with its key as in ``expect``: ``nodes.tip.position step 2``, ``nodes.tip.velocity time 0.5``,
``factor limit_point 1``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..checks import Answer, asked
from ..description.records import say, unknown
from ..description.scene import Expect, Scene
from ..equilibria.quantities import VALUE
from ..errors import SceneError
from ..mathematics.arrays import Array

__all__ = ["Wanted", "parted", "wanted_of"]

KEYS = {
    "nodes": ("position", "quaternion", "angle", "velocity"),
    "members": ("position", "quaternion", "angle", "force", "moment", "curvature"),
    "reactions": ("force", "moment"),
    "springs": ("angle", "moment", "travel", "force", "stop"),
    "motions": ("moment", "force"),
    "contacts": ("force", "at", "gap"),
    "energy": ("elastic", "loads", "total", "kinetic"),
    "momentum": ("linear", "angular"),
    "certificate": ("residual", "negative", "smallest", "error_estimate"),
    "modes": ("omega", "rigid", "damping", "growing", "buckling"),
}
"""What answers have that is made of numbers."""

ALONE = ("factor", "omega")
"""What has no further name."""

SELECTORS = ("at", "step", "time", "crossing", "limit_point", "bifurcation", "flutter_point")
"""Keys that say where and of which answer."""

COUNTS = SELECTORS[3:]

WORDS = re.compile(rf"(?P<name>.*\S)\s+(?P<key>{'|'.join(SELECTORS)})\s+(?P<value>{VALUE})\s*")

COMING_AND_GOING = ("contacts", "modes")
"""Kinds of which an answer has more or less as the numbers of the scene are."""


@dataclass(frozen=True)
class Wanted:
    """A quantity that is wanted of each answer.

    Attributes
    ----------
    text : str
        As it was asked for; its name in the table.
    expect : Expect
        Where to look.
    """

    text: str
    expect: Expect

    @property
    def optional(self) -> bool:
        """Whether some answers may be without it: what touches, how many modes, critical points."""
        selected = any(getattr(self.expect, key) is not None for key in COUNTS)
        return selected or self.expect.quantity.partition(".")[0] in COMING_AND_GOING

    def numbers(self, answer: Answer) -> Array:
        """What an answer says, as numbers, (n,); none where it may be without it and is.

        Raises
        ------
        SceneError
            It has no such quantity, or this is not made of numbers.
        """
        try:
            found = asked(answer, self.expect)
        except SceneError as error:
            if self.optional:
                return np.zeros(0)
            raise SceneError(error.bare, ("quantities", self.text)) from None
        if found is None and self.optional:
            return np.zeros(0)
        try:
            return np.atleast_1d(np.asarray(found, dtype=float)).ravel()
        except (TypeError, ValueError):
            message = f"found {say(found)}, accepted: a quantity made of numbers"
            raise SceneError(message, ("quantities", self.text)) from None


def wanted_of(scene: Scene, names: Sequence[str]) -> tuple[Wanted, ...]:
    """The quantities of some names.

    Raises
    ------
    SceneError
        There is none, one is named twice, or the answers of such a scene have no such quantity.
    """
    if isinstance(names, str) or not names:
        raise SceneError(f"found {say(names)}, accepted: a list of names, as ['nodes.tip.position']", ("quantities",))
    found = tuple(_wanted(name) for name in names)
    for i, one in enumerate(found):
        if one.text in [other.text for other in found[:i]]:
            raise SceneError(f"found {one.text!r} twice, accepted: each once", ("quantities",))
        try:
            scene.replace(expect=(one.expect,))
            _check_key(one.expect)
        except SceneError as error:
            raise SceneError(error.bare, ("quantities", one.text)) from None
    return found


def parted(text: str) -> tuple[str, dict[str, str]]:
    """A quantity and its selectors.

    >>> parted("members.my beam.moment at 0.5 step 2")
    ('members.my beam.moment', {'step': '2', 'at': '0.5'})
    """
    selectors: dict[str, str] = {}
    while match := WORDS.fullmatch(text):
        text, selectors[match["key"]] = match["name"], match["value"]
    return text, selectors


def _wanted(text: str) -> Wanted:
    """A quantity with its selectors, which stand behind the name."""
    if not isinstance(text, str):
        raise SceneError(f"found {say(text)}, accepted: names, as 'nodes.tip.position'", ("quantities",))
    name, selectors = parted(text.strip())
    keys: dict[str, float] = {}
    for key, value in selectors.items():
        try:
            keys[key] = int(value) if key in COUNTS else float(value)
        except ValueError:
            raise SceneError(f"found {value!r}, accepted: a number after {key!r}", ("quantities", text)) from None
    try:
        return Wanted(text.strip(), Expect.from_dict({"quantity": name, "value": True, **keys}))
    except SceneError as error:
        raise error.within("quantities", text) from None


def _check_key(expect: Expect) -> None:
    kind, *rest = expect.quantity.split(".")
    if kind in ALONE and not rest:
        return
    if kind not in KEYS:
        raise SceneError(unknown(kind, [*KEYS, *ALONE]))
    named = kind in ("nodes", "members", "reactions", "springs", "motions", "contacts")
    if len(rest) != (2 if named else 1):
        raise SceneError(f"found {expect.quantity!r}, accepted: {kind}.{'NAME.' if named else ''}KEY")
    if rest[-1] not in KEYS[kind]:
        raise SceneError(unknown(rest[-1], KEYS[kind]))
    if (kind == "members") != (expect.at is not None):
        where = "a place, as members.beam.moment at 0.5" if kind == "members" else "a place with members only"
        raise SceneError(f"found {'none' if kind == 'members' else f'{expect.at:g}'}, accepted: {where}")
