"""Changes of a scene by the names of its keys: ``{"loads.tip.value": [0, 5], "analysis.accuracy": 1e-8}``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..errors import SceneError
from .records import Record, keys_of, name_of, say, unknown
from .shapes import end_of

__all__ = ["FACTOR", "Branch", "Making", "branch_of", "carry_ends", "with_entries"]

FACTOR = "factor"
"""The name that stands for all ``steps`` of the analysis."""

Making = Callable[[Record, Mapping[str, Any]], Record]
"""A record with other entries."""


class Branch(dict[str, Any]):
    """New entries of a record, a table or a list by their keys; an entry is a value or a branch of its own."""


def branch_of(*changes: Mapping[str, Any]) -> Branch:
    """New entries of a scene from values by names with dots; a value may be a branch itself.

    Raises
    ------
    SceneError
        Something that is no name, or a key that is given twice, or as a whole and in part.
    """
    found = Branch()
    for table in changes:
        if not isinstance(table, Mapping):
            accepted = "a table of values by their names, as {'loads.tip.value': [0, 5]}"
            raise SceneError(f"found {say(table)}, accepted: {accepted}")
        for name, value in table.items():
            if not isinstance(name, str):
                raise SceneError(f"found {say(name)}, accepted: the name of a key, as 'loads.tip.value'")
            _put(found, name.split("."), value)
    return found


def _put(branch: Branch, path: Sequence[str], value: Any) -> None:
    """A value, or a branch of values, at its place."""
    for i, key in enumerate(path):
        last = i == len(path) - 1
        if last and not isinstance(value, Branch):
            fits, branch[key] = key not in branch, value
        else:
            branch = branch.setdefault(key, Branch())
            fits = isinstance(branch, Branch)
        if not fits:
            message = "found values for the whole and for a part of it, or two for the same, accepted: one value"
            raise SceneError(message, tuple(path))
    for key, part in value.items() if isinstance(value, Branch) else ():
        try:
            _put(branch, [key], part)
        except SceneError as error:
            raise error.within(*path) from None


def with_entries(here: Any, new: Any, make: Making) -> Any:
    """A record, table or list with other entries; of records only those are made anew that change.

    Parameters
    ----------
    here : what stands there now
    new : a :class:`Branch`, or a value that takes its place
    make : how a changed record is made

    Raises
    ------
    SceneError
        There is no such key or entry, or a record does not accept a value.
    """
    if not isinstance(new, Branch):
        return _number(new) if isinstance(here, (int, float)) else new
    if isinstance(here, Record):
        return make(here, {key: _entry(here, key, part, make) for key, part in new.items()})
    if isinstance(here, Mapping):
        entries = dict(here)
        for key, part in new.items():
            entries[key] = _entry(here, key, part, make)
            if part is None:
                del entries[key]
        return entries
    if isinstance(here, (list, tuple)):
        items = list(here)
        for key, part in new.items():
            entry = _entry(here, key, part, make)
            items[int(key)] = entry
        return tuple(items)
    raise SceneError(f"found {say(here)} in the scene, which has no {next(iter(new))!r}, accepted: the whole value")


def _number(new: Any) -> Any:
    """A new value of a number: answers have arrays of one, and tables of numbers have floats that count elements."""
    if getattr(new, "shape", None) == (1,):
        new = new[0]
    return int(new) if isinstance(new, float) and new.is_integer() else new


def _entry(here: Any, key: str, part: Any, make: Making) -> Any:
    """A new entry of a record, table or list."""
    field, name = None, key
    if isinstance(here, Record):
        known: Any = keys_of(type(here))
        name = name_of(type(here), key)
        field = type(here).model_fields.get(name)
    elif isinstance(here, Mapping):
        known = here
    else:
        known = [str(i) for i in range(len(here))]
    new = isinstance(here, Mapping) and part is not None and not isinstance(part, Branch)
    if field is None and key not in known and not new:
        whole = " (a new entry is given as a whole)" if isinstance(here, Mapping) and part is not None else ""
        raise SceneError(unknown(key, known, "such entries") + whole)
    now = None if new else getattr(here, name) if field else here[key if isinstance(here, Mapping) else int(key)]
    if field is not None and isinstance(part, Branch) and field.discriminator in part:
        # Another type has other keys.
        return dict(part)
    try:
        return with_entries(now, part, make)
    except SceneError as error:
        raise error.within(key) from None


def carry_ends(scene: Any, new: Branch, make: Making) -> None:
    """Let free nodes follow the ends of shapes that change, where a shape says itself where it ends."""
    for name, member in scene.members.items():
        first, last = member.nodes[0], member.nodes[-1]
        bent, begun = _at(new, "members", name), _at(new, "nodes", first)
        if bent is None or begun is None or not ("shape" in bent or "position" in begun):
            continue
        end = _at(new, "nodes", last)
        shared = any(last in other.nodes for key, other in scene.members.items() if key != name)
        if end is None or "position" in end or shared or scene.nodes[last].support != "free":
            continue
        shape, begin = _changed(member, bent, "shape", make), _changed(scene.nodes[first], begun, "position", make)
        place = end_of(shape, [*begin, 0.0][:3], member.b2)
        if place is not None:
            new.setdefault("nodes", Branch()).setdefault(last, Branch())["position"] = tuple(place.tolist())


def _at(new: Branch, *path: str) -> Branch | None:
    """The new entries of a record; None where the record or its table is given as a whole."""
    branch: Any = new
    for key in path:
        branch = branch.get(key, Branch())
        if not isinstance(branch, Branch):
            return None
    return branch


def _changed(record: Record, new: Branch, key: str, make: Making) -> Any:
    if key not in new:
        return getattr(record, key)
    return getattr(make(record, {key: _entry(record, key, new[key], make)}), key)
