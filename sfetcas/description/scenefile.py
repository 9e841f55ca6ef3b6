"""Scene files: TOML and JSON with the same keys, read into a scene and written from one."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from pathlib import Path
from typing import Any

import tomli

from ..errors import SceneError
from ..files import UnreadableError, read_file
from .records import say
from .scene import Scene, check_scene

try:
    import tomli_w
except ImportError:
    tomli_w = None  # type: ignore[assignment]

__all__ = ["dump", "load", "parse"]

LARGEST = 50_000_000
"""Bytes of a scene file: a hundred thousand members take half of it, and are more than can be solved."""

MOST_PARTS = 20
"""Of a key with dots: scenes need a few, and the reader of TOML takes minutes with thousands."""

_QUOTED = re.compile(
    r'#[^\n]*|"""(?:[^\\]|\\.)*?(?:"""|\\?\Z)|"(?:[^"\\\n]|\\[^\n])*"?'
    r"|'{3}.*?(?:'{3}|\Z)|'[^'\n]*'?",
    re.DOTALL,
)
"""Comments and texts of TOML, also without their ends, so that nothing is read twice."""

_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]+[ \t]*\.[ \t]*){{{MOST_PARTS}}}", re.ASCII)

_ENDINGS = {".toml": "toml", ".json": "json"}


def load(path: str | os.PathLike[str]) -> Scene:
    """The scene in a file, TOML or JSON by its ending.

    Raises
    ------
    SceneError
        Missing, unreadable or empty file, syntax error, or anything that a scene does not accept; the
        sentence starts with the path.
    """
    try:
        return parse(_read(Path(path)), _format(Path(path)), Path(path).parent)
    except SceneError as error:
        raise SceneError(str(error), (os.fspath(path),)) from None


def parse(text: str, format: str, folder: Path | None = None) -> Scene:
    """The scene in a text.

    Parameters
    ----------
    text : the content of a scene file
    format : toml or json
    folder : folder of relative file names in the scene; left out: the current one

    Raises
    ------
    SceneError
        Syntax error with its line, or anything that a scene does not accept.
    """
    if format not in _ENDINGS.values():
        raise SceneError(f"found the format {format!r}, accepted: toml, json")
    if not text.strip():
        raise SceneError("the file is empty, accepted: a scene with sections, nodes and members")
    try:
        values = _values(text, format)
        return Scene.from_dict(values if folder is None else _within(values, folder))
    except RecursionError:
        raise SceneError(f"not read as {format.upper()}: lists or tables are nested too deeply") from None


def _values(text: str, format: str) -> Any:
    """The tables of a text."""
    try:
        if format == "toml":
            _check_keys(text)
        values = tomli.loads(text) if format == "toml" else json.loads(text, object_pairs_hook=_table)
        if "\\ud" in text.lower():
            # Half of a pair stands for no character, and could neither be printed nor written.
            json.dumps(values, ensure_ascii=False, default=str).encode()
        return values
    except SceneError:
        raise
    except UnicodeEncodeError as error:
        raise SceneError(f"not read as JSON: found {error.object[error.start]!a}, half of a character") from None
    except (tomli.TOMLDecodeError, json.JSONDecodeError) as error:
        raise SceneError(f"not read as {format.upper()}: {error}") from None
    except ValueError:
        # Python reads no longer ones, as that takes long.
        found = "a whole number with over 4300 digits"
        raise SceneError(f"not read as {format.upper()}: found {found}, accepted: finite numbers") from None


def _check_keys(text: str) -> None:
    """Refuse keys of TOML with very many parts; what is quoted is one part, or no key."""
    long = _LONG_KEY.search(_QUOTED.sub(lambda found: "" if found[0].startswith("#") else "x", text))
    if long:
        raise SceneError(f"not read as TOML: found the key {say(long[0])}, accepted: {MOST_PARTS} parts at most")


def dump(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene, TOML or JSON by the ending of the path; a file there is replaced only as a whole.

    Raises
    ------
    SceneError
        Other ending, no permission, no space or no package for TOML; the sentence starts with the path.
    """
    check_scene(scene, "dump({}, ...)")
    for name, field in scene.fields.items():
        if field.function is not None:
            message = "found a Python function, which no file holds, accepted: the types uniform, linear and dipole"
            raise SceneError(message, ("fields", name, "function"))
    try:
        _write(Path(path), _text(scene, _format(Path(path))))
    except SceneError as error:
        raise SceneError(str(error), (os.fspath(path),)) from None


def _format(path: Path) -> str:
    if path.suffix.lower() not in _ENDINGS:
        raise SceneError(f"found the ending {path.suffix!r}, accepted: {', '.join(_ENDINGS)}")
    return _ENDINGS[path.suffix.lower()]


def _read(path: Path) -> str:
    _format(path)
    try:
        return read_file(path, LARGEST, "a scene file").decode("utf-8-sig")
    except FileNotFoundError:
        raise SceneError("there is no such file") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"found a byte that is not UTF-8 at position {error.start}, accepted: UTF-8") from None
    except UnreadableError as error:
        raise SceneError(str(error)) from None


FILES = {"members": ("stiffness", "mass"), "histories": ("table",), "fields": ("table",)}
"""Keys that may name a file beside that of the scene, by their tables."""


def _within(values: Any, folder: Path) -> Any:
    """The values with the files of matrices and tables named from the folder of the scene."""
    for table, keys in FILES.items():
        entries = values.get(table) if isinstance(values, dict) else None
        for entry in entries.values() if isinstance(entries, dict) else ():
            for key in keys:
                if isinstance(entry, dict) and isinstance(entry.get(key), str):
                    entry[key] = str(folder / entry[key])
    return values


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        double = Counter(keys).most_common(1)[0][0]
        raise SceneError(f"not read as JSON: the key {say(double)} stands twice in one table")
    return table


def _text(scene: Scene, format: str) -> str:
    if format == "json":
        return json.dumps(scene.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if tomli_w is None:
        raise SceneError("TOML cannot be written without the package tomli-w: install it or write .json")
    return tomli_w.dumps(scene.to_dict())


def _write(path: Path, text: str) -> None:
    target = path.resolve()
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        with part.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
        os.replace(part, target)
    except (OSError, ValueError) as error:
        raise SceneError(f"the file cannot be written: {_reason(error)}") from None
    finally:
        part.unlink(missing_ok=True)
