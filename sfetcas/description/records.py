"""Records: frozen data validated at construction, and the number types they are made of."""

from __future__ import annotations

import difflib
import math
import operator
import re
from collections.abc import Iterable, Mapping, Sequence, Set
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from .. import tolerances
from ..errors import SceneError
from ..mathematics.arrays import Array
from .described import Described

__all__ = [
    "Direction",
    "Fraction",
    "Named",
    "NotNegative",
    "Number",
    "Numbers",
    "OnPart",
    "Positive",
    "Record",
    "Sized",
    "Turn",
    "Vector",
    "brief",
    "counted",
    "enumerated",
    "keys_of",
    "listed",
    "listed_numbers",
    "name_of",
    "nearest",
    "number",
    "plain",
    "say",
    "sentence",
    "turn",
    "unknown",
    "whole",
]

T = TypeVar("T")
R = TypeVar("R", bound="Record")


def say(value: object) -> str:
    """A value as text, short enough for a message."""
    try:
        return _short(repr(list(value) if isinstance(value, tuple) else value))
    except ValueError:
        return "a whole number with over 4300 digits"


def brief(value: object) -> str:
    """A value as Python would write it; of a long text or list the beginning.

    >>> brief((0.0, 1.0)), brief(tuple(range(40)))
    ('(0.0, 1.0)', '(0, 1, 2, 3, ... and 36 more)')
    """
    if isinstance(value, Mapping):
        entries = [f"{key!r}: {brief(entry)}" for key, entry in list(value.items())[:LISTED]]
        return "{" + _cut(entries, len(value)) + "}"
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (tuple, list)):
        rows = len(value) > 1 and all(isinstance(entry, (tuple, list)) and len(entry) > 1 for entry in value)
        if rows and sum(map(len, value)) > LISTED:
            return f"({counted(len(value), 'row')} of numbers)"
        most = LISTED if len(value) <= LISTED else LISTED // 2
        entries = [brief(entry) for entry in value[:most]]
        listed = _cut(entries, len(value))
        return f"[{listed}]" if isinstance(value, list) else f"({listed}{',' if len(value) == 1 else ''})"
    text = repr(value)
    # A record is brief by itself.
    return text if isinstance(value, BaseModel) or len(text) <= LONGEST else repr(str(value)[: LONGEST - 3] + "...")


def _cut(entries: Sequence[str], number: int) -> str:
    more = [f"... and {number - len(entries)} more"] if number > len(entries) else []
    return ", ".join([*entries, *more])


LISTED, LONGEST = 8, 80
"""Entries of a list and characters of a text up to which they are printed as a whole."""


def _short(word: str) -> str:
    """A name, short enough for a list."""
    return word if len(word) <= 60 else word[:57] + "..."


def nearest(word: str, known: Iterable[str]) -> str:
    """'; did you mean ...?' where one of the known words is near, else the list of them."""
    known = sorted(known)
    close = difflib.get_close_matches(word, known, n=1)
    return f"did you mean {say(close[0])}?" if close else "accepted: " + ", ".join(map(_short, known))


def enumerated(names: Sequence[str], kind: str = "") -> str:
    """The first four of some names, and how many more there are; ``kind``, in the plural where need be, before them."""
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    before = f"{kind}{'s' if len(names) > 1 else ''} " if kind else ""
    return f"{before}{', '.join(names[:4])}{more}"


def unknown(word: str, known: Iterable[str], kind: str = "names") -> str:
    """'found ..., accepted: ...', with the nearest of the known words where one is near."""
    known = sorted(known)
    if not known:
        return f"found {say(word)}, but the scene has no {kind}"
    listed = ", ".join(map(_short, known[:12])) + (", ..." if len(known) > 12 else "")
    close = difflib.get_close_matches(word, known, n=1)
    return f"found {say(word)}, accepted: {listed}" + (f"; did you mean {say(close[0])}?" if close else "")


def number(value: Any) -> float:
    """A finite number as a float.

    Raises
    ------
    ValueError
        Anything else, also a text, true and false.
    """
    kind = getattr(getattr(value, "dtype", None), "kind", "none")
    scalar = getattr(value, "shape", None) == () and kind in "iuf"
    if isinstance(value, bool) or not (scalar or isinstance(value, (int, float))):
        raise ValueError(f"found {say(value)}, accepted: a number")
    try:
        found = float(value)
    except OverflowError:
        raise ValueError("found a whole number with over 300 digits, accepted: a finite number") from None
    if not math.isfinite(found):
        raise ValueError(f"found {found}, accepted: a finite number")
    return found


def whole(value: Any, least: int, most: int | None = None, *, what: str = "whole number", name: str = "") -> int:
    """A whole number within limits as an int, from Python or NumPy; messages call it ``what``, with its ``name``.

    Raises
    ------
    SceneError
        Anything else, also booleans and floats.
    """
    try:
        found = None if isinstance(value, bool) else operator.index(value)
    except TypeError:
        found = None
    if found is None or found < least or (most is not None and found > most):
        span = f"from {least}" + ("" if most is None else f" to {most}")
        raise SceneError(f"found {say(value)}, accepted: a {what} {span}", (name,) if name else ())
    return found


def listed(value: Any, accepted: str) -> tuple[Any, ...]:
    """The entries of a list, a tuple or an array.

    Raises
    ------
    ValueError
        Anything else, also a text and a set, which has no order.
    """
    unordered = isinstance(value, (str, bytes, Mapping, Set))
    if unordered or not isinstance(value, Iterable) or getattr(value, "shape", None) == ():
        raise ValueError(f"found {say(value)}, accepted: {accepted}")
    return tuple(value)


def _positive(value: float) -> float:
    if value <= 0.0:
        raise ValueError(f"found {value:g}, accepted: a number above zero")
    return value


def _sized(value: float) -> float:
    if not LEAST <= value <= 1.0 / LEAST:
        raise ValueError(f"found {value:g}, accepted: from {LEAST:g} to {1.0 / LEAST:g}")
    return value


LEAST = 1e-100
"""Least number whose square, times other numbers, is above zero in double precision."""


def _not_negative(value: float) -> float:
    if value < 0.0:
        raise ValueError(f"found {say(value)}, accepted: zero or a number above zero")
    return value


def _vector(value: Any, accepted: str = "[x, y] or [x, y, z]") -> tuple[float, float, float]:
    entries = tuple(number(entry) for entry in listed(value, accepted))
    if len(entries) not in (2, 3):
        raise ValueError(f"found {say(entries)}, accepted: {accepted}")
    return (entries[0], entries[1], entries[2] if len(entries) == 3 else 0.0)


def turn(value: Any) -> float | tuple[float, float, float]:
    """A finite number as a float, or a vector as its three.

    Raises
    ------
    ValueError
        Anything else.
    """
    scalar = isinstance(value, (int, float)) or getattr(value, "shape", None) == ()
    return number(value) if scalar else _vector(value, "a number, [x, y] or [x, y, z]")


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    largest = max(map(abs, value))
    if not largest:
        raise ValueError(f"found {say(value)}, accepted: a direction, which is not of zero length")
    if SQUARED[0] < largest < SQUARED[1]:
        return value
    x, y, z = (each / largest for each in value)
    return x, y, z


SQUARED = 1e-100, 1e100
"""Numbers between these have squares; only the direction of longer and shorter directions is kept."""


def _fraction(value: float) -> float:
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"found {value:g}, accepted: a fraction of the length, from 0 to 1")
    return value


def listed_numbers(value: Any) -> tuple[float, ...]:
    """One or more finite numbers from a list, a tuple or an array.

    Raises
    ------
    ValueError
        Anything else.
    """
    entries = tuple(number(entry) for entry in listed(value, "a list of numbers"))
    if not entries:
        raise ValueError("found an empty list, accepted: a list of numbers")
    return entries


def _read_only(value: Mapping[str, T]) -> Mapping[str, T]:
    for name in value:
        if not name.strip() or "." in name or not name.isprintable():
            raise ValueError(f"found the name {name!r}, accepted: a printable name without a dot")
    return MappingProxyType(dict(value))


Number = Annotated[float, BeforeValidator(number)]
"""A finite number; integers are taken, booleans and strings are not."""

Positive = Annotated[float, BeforeValidator(number), AfterValidator(_positive)]
"""A finite number above zero."""

Sized = Annotated[Positive, AfterValidator(_sized)]
"""A number above zero whose square is a number, too."""

NotNegative = Annotated[float, BeforeValidator(number), AfterValidator(_not_negative)]
"""A number of zero or above."""

Vector = Annotated[tuple[float, float, float], BeforeValidator(_vector)]
"""Two or three finite numbers, kept as three (z = 0 where it is left out)."""

Direction = Annotated[tuple[float, float, float], BeforeValidator(_vector), AfterValidator(_direction)]
"""A vector of any length but zero."""

Turn = Annotated[float | tuple[float, float, float], BeforeValidator(turn)]
"""A moment or a rotation: a number, about the axis that its place has, or a vector in the fixed axes."""

Fraction = Annotated[float, BeforeValidator(number), AfterValidator(_fraction)]
"""A fraction of a length, from 0 to 1."""

Numbers = Annotated[tuple[float, ...], BeforeValidator(listed_numbers)]
"""One or more finite numbers."""

Named = Annotated[Mapping[str, T], AfterValidator(_read_only)]
"""A read-only table by name."""


class Record(Described):
    """Frozen data with known keys only; a wrong value raises :class:`~sfetcas.SceneError` at construction."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True, populate_by_name=True)

    def __init__(self, *unnamed: NoReturn, **values: Any) -> None:
        if unnamed:
            own, key = type(self).__name__, next(iter(type(self).model_fields))
            found = "a value" if len(unnamed) == 1 else f"{len(unnamed)} values"
            raise SceneError(f"{own}: found {found} without a name, accepted: keys by their names, as {own}({key}=...)")
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise sentence(error, type(self)) from None

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), self.to_dict())

    def __deepcopy__(self: R, memo: dict[int, Any] | None = None) -> R:
        return self

    def __repr__(self) -> str:
        """As it would be made, without what stands at its default."""
        fields = type(self).model_fields.items()
        given = ((name, getattr(self, name)) for name, field in fields if not _is_default(getattr(self, name), field))
        return f"{type(self).__name__}({', '.join(f'{name}={brief(value)}' for name, value in given)})"

    __str__ = __repr__

    @classmethod
    def from_dict(cls: type[R], values: Mapping[str, Any]) -> R:
        """The record from a table of its keys, as a file gives it.

        Raises
        ------
        SceneError
            Anything that is not accepted.
        """
        if not isinstance(values, Mapping):
            raise SceneError(f"found {say(values)}, accepted: a table")
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Tables, lists, texts and numbers; what stands at its default is left out, but for ``type``."""
        pairs = ((field.alias or name, getattr(self, name), field) for name, field in type(self).model_fields.items())
        return {n: plain(v) for n, v, field in pairs if n == "type" or not _is_default(v, field)}

    def replace(self: R, **changes: Any) -> R:
        """A copy with other values, validated anew; None stands for the default."""
        changes = {name_of(type(self), key): value for key, value in changes.items()}
        kept = {name: getattr(self, name) for name in self.model_fields_set - changes.keys()}
        return type(self)(**kept, **{name: value for name, value in changes.items() if value is not None})


def keys_of(record: type[BaseModel]) -> dict[str, str]:
    """The keys of a record as files have them, and the names of these in Python: ``from`` is ``from_`` there."""
    return {field.alias or name: name for name, field in record.model_fields.items()}


def name_of(record: type[BaseModel], key: str) -> str:
    """The name in Python of a key; what is no key as it is."""
    return keys_of(record).get(key, key)


def counted(number: int, one: str, more: str | None = None) -> str:
    """A number and what it counts: ``1 way out``, ``2 ways out``; without ``more`` the plural ends on s."""
    return f"{number} {one if number == 1 else more or one + 's'}"


def plain(value: Any) -> Any:
    """A value of a record as tables, lists, texts and numbers."""
    if isinstance(value, Record):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):
        return value.tolist()
    return [plain(entry) for entry in value] if isinstance(value, (tuple, list)) else value


def _is_default(value: Any, field: FieldInfo) -> bool:
    default = field.get_default(call_default_factory=True, validated_data={})
    return bool(value is default or plain(value) == plain(default))


class OnPart:
    """What acts on a part of a member, from ``from_`` to ``to``."""

    if TYPE_CHECKING:  # fields of the records that follow, which say where in their order they stand
        from_: float
        to: float

    def _check_part(self) -> None:
        if not self.to - self.from_ > tolerances.DECIMAL:
            raise SceneError(f"found {self.from_:g} to {self.to:g}, accepted: an end after the beginning", ("to",))

    @property
    def part(self) -> tuple[float, float]:
        """Fractions (2,) of the length of the member where it begins and ends."""
        return self.from_, self.to

    def inside(self, x: Array) -> Array:
        """Whether fractions x (any shape) of the length of the member lie where it acts."""
        return (x > self.from_) & (x < self.to)


def _restore(record: type[Record], values: dict[str, Any]) -> Record:
    return record(**values)


_KINDS = {
    "string": "a text",
    "bool": "true or false",
    "tuple": "a list",
    "list": "a list",
    "model": "a table",
    "dict": "a table",
    "mapping": "a table",
    "is": "one of its tables",
}


def sentence(error: ValidationError, record: type[BaseModel]) -> SceneError:
    """The first finding of pydantic as one sentence with its place; unknown keys come first."""
    findings = error.errors(include_url=False)
    # a key is often missing because it is misspelt
    finding = min(findings, key=lambda each: each["type"] != "extra_forbidden")
    where = _place(finding["loc"], record)
    context = finding.get("ctx", {})
    match finding["type"]:
        case "value_error" if isinstance(context["error"], SceneError):
            return context["error"].within(*where)
        case "value_error":
            return SceneError(str(context["error"]), where)
        case "extra_forbidden":
            return SceneError(f"unknown key {say(where[-1])}; {nearest(where[-1], keys_of(record))}", where[:-1])
        case "missing":
            return SceneError(f"the key {where[-1]!r} is missing", where[:-1])
        case "union_tag_not_found":
            return SceneError("the key 'type' is missing", where)
        case "union_tag_invalid":
            return SceneError(_choice(context["tag"], context["expected_tags"]), (*where, "type"))
        case "literal_error":
            return SceneError(_choice(finding["input"], context["expected"]), where)
    accepted = _KINDS.get(finding["type"].split("_")[0], finding["msg"].removeprefix("Input should be "))
    return SceneError(f"found {say(finding['input'])}, accepted: {accepted}", where)


def _place(loc: tuple[int | str, ...], record: type[BaseModel]) -> tuple[str, ...]:
    """The keys on the way to a finding, without what pydantic adds to them."""
    field = record.model_fields.get(name_of(record, str(loc[0]))) if loc else None
    tagged = field is not None and _tagged(field)
    parts = (str(part) for part in (loc[:1] + loc[2:] if tagged else loc))
    return tuple(part for part in parts if part != "[key]" and not part.startswith(SCHEMAS))


SCHEMAS = ("function-", "tuple[", "list[", "literal[")
"""How names begin that pydantic gives to one of several types of a key."""


def _tagged(field: FieldInfo) -> bool:
    """Whether a key takes one of several records, told apart by their ``type``, or also nothing."""
    inner = (info for part in get_args(field.annotation) for info in getattr(part, "__metadata__", ()))
    return any(getattr(info, "discriminator", None) is not None for info in (field, *inner))


def _choice(found: Any, expected: str) -> str:
    words = re.findall("'([^']*)'", expected)
    return unknown(found, words) if isinstance(found, str) else f"found {say(found)}, accepted: {', '.join(words)}"
