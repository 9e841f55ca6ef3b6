"""Records: frozen data validated at construction, and the number types they are made of."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError

from .errors import SceneError

__all__ = ["Named", "Number", "Positive", "Record", "Vector", "nearest", "say"]

T = TypeVar("T")


def say(value: object) -> str:
    """A found value, short enough for a sentence."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(word: str, known: Iterable[str]) -> str:
    """'; did you mean ...?' where one of the known words is near, else the list of them."""
    known = sorted(known)
    close = difflib.get_close_matches(word, known, n=1)
    return f"did you mean {close[0]!r}?" if close else "accepted: " + ", ".join(known)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        if not (hasattr(value, "__float__") and getattr(value, "shape", None) == ()):
            raise ValueError(f"found {say(value)}, accepted: a number")
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"found {value}, accepted: a finite number")
    return value


def _positive(value: float) -> float:
    if value <= 0.0:
        raise ValueError(f"found {value:g}, accepted: a number above zero")
    return value


def _vector(value: Any) -> tuple[float, float, float]:
    if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
        raise ValueError(f"found {say(value)}, accepted: [x, y] or [x, y, z]")
    entries = tuple(_number(entry) for entry in value)
    if len(entries) not in (2, 3):
        raise ValueError(f"found {len(entries)} numbers, accepted: [x, y] or [x, y, z]")
    return (entries[0], entries[1], entries[2] if len(entries) == 3 else 0.0)


def _read_only(value: Mapping[str, T]) -> Mapping[str, T]:
    return MappingProxyType(dict(value))


Number = Annotated[float, BeforeValidator(_number)]
"""A finite number; integers are taken, booleans and strings are not."""

Positive = Annotated[float, BeforeValidator(_number), AfterValidator(_positive)]
"""A finite number above zero."""

Vector = Annotated[tuple[float, float, float], BeforeValidator(_vector)]
"""Two or three finite numbers, kept as three (z = 0 where it is left out)."""

Named = Annotated[Mapping[str, T], AfterValidator(_read_only)]
"""A read-only table by name."""


class Record(BaseModel):
    """Frozen data with known keys only; a wrong value raises :class:`SceneError` at construction."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise sentence(error, type(self)) from None


def sentence(error: ValidationError, record: type[BaseModel]) -> SceneError:
    """The first finding of pydantic as one sentence with its place."""
    finding = error.errors(include_url=False)[0]
    where = tuple(str(part) for part in finding["loc"])
    if finding["type"] == "extra_forbidden":
        return SceneError(f"unknown key {where[-1]!r}; {nearest(where[-1], record.model_fields)}", where[:-1])
    if finding["type"] == "missing":
        return SceneError(f"the key {where[-1]!r} is missing", where[:-1])
    message = finding["msg"].removeprefix("Value error, ")
    if finding["type"] not in ("value_error", "assertion_error"):
        message = f"found {say(finding['input'])}, accepted: {message[0].lower()}{message[1:]}"
    return SceneError(message, where)
