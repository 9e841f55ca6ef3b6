"""What later versions bring: keys and values of a scene that are known by name and refused by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import model_validator

from ..errors import SceneError
from .records import Record

__all__ = ["Staged", "refusal"]

_LATER = {
    "Scene.rotating": "rotating axes",
    "Node.velocity": "velocities",
    "Member.spin": "angular velocities of members",
    "Analysis.type = modes": "modes",
    "Analysis.type = dynamic": "dynamics",
    "Analysis.modes": "modes",
    "Analysis.end": "time spans",
    "Analysis.output": "spacings of answers in time",
    "Analysis.step": "time steps",
    "Analysis.integrator": "integrators",
    "Expect.time": "expectations at a time",
    "Expect.flutter_point": "expectations at a flutter point",
}
"""Each row leaves with the version that brings what it names: ``Record.key`` or ``Record.key = value``."""


def refusal(place: str) -> str | None:
    """The sentence that refuses a row of the table; None where there is no such row."""
    return f"{_LATER[place]} are not available yet" if place in _LATER else None


class Staged(Record):
    """A record that refuses what later versions bring by name."""

    @model_validator(mode="before")
    @classmethod
    def _refuse_later(cls, values: Any) -> Any:
        for key, value in values.items() if isinstance(values, Mapping) else ():
            place = f"{cls.__name__}.{key}"
            message = refusal(place) or refusal(f"{place} = {value}" if isinstance(value, str) else place)
            if message:
                raise SceneError(message, (str(key),))
        return values
