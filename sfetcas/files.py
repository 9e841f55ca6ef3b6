"""Reading and writing files safely: only regular files of limited size are read; what is written appears as a whole."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .errors import SceneError

__all__ = ["UnreadableError", "read_file", "write_file", "write_folder"]


class UnreadableError(ValueError):
    """A file that is refused; the sentence says what it is and what is accepted, without the name of the file."""


KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def read_file(path: str | os.PathLike[str], most: int, accepted: str = "a plain file") -> bytes:
    """The content of a plain file, or of one that a link leads to; never that of a device or a pipe, which may not end.

    Parameters
    ----------
    path
    most : int
        Largest size in bytes; a larger file is refused before it is read.
    accepted : str
        The kind of file that is accepted, in words for the message.

    Raises
    ------
    FileNotFoundError
    UnreadableError
        Anything else that is no plain file, cannot be read or is too large.
    """
    try:
        # Opening alone may wait for a pipe, or do something to a device.
        _check_plain(os.stat(path), accepted)
        with open(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)), "rb") as file:
            found = os.fstat(file.fileno())
            _check_plain(found, accepted)
            # What the system makes up as it is read has no size before.
            content = b"" if found.st_size > most else file.read(most + 1)
    except FileNotFoundError:
        raise
    except (OSError, ValueError) as error:
        if isinstance(error, UnreadableError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise UnreadableError(f"the file cannot be read: {reason}") from None
    size = max(found.st_size, len(content))
    if size > most:
        raise UnreadableError(f"found {size / 1e6:.4g} MB, accepted: {accepted} of {most / 1e6:.4g} MB at most")
    return content


def _check_plain(found: os.stat_result, accepted: str) -> None:
    if not stat.S_ISREG(found.st_mode):
        kind = KINDS.get(stat.S_IFMT(found.st_mode), "no file")
        raise UnreadableError(f"this is {kind}, accepted: {accepted}")


def write_file(path: Path, writer: Callable[[Path], Any]) -> None:
    """Write a file atomically: under a temporary name in the same folder, then renamed.

    Parameters
    ----------
    path : Path
        The final name; an existing file is replaced.
    writer : callable
        Writes the content to the path that it is given, which has the same ending.

    Raises
    ------
    SceneError
        The file could not be written, or what the writer raises.
    """
    name = ""
    try:
        # By its ending a writer knows its kind; a long one is of no kind, and there may be no longer name.
        suffix = path.suffix if len(path.suffix) < 16 else ""
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=suffix)
        os.close(handle)
        writer(Path(name))
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except SceneError:
        # What is written, not where.
        raise
    except (OSError, ValueError, ArithmeticError) as error:
        raise SceneError(f"{path}: could not be written: {error}") from None
    finally:
        if name:
            Path(name).unlink(missing_ok=True)


def write_folder(path: Path, writer: Callable[[Path], Any]) -> None:
    """Write a folder of files atomically: under a temporary name, then renamed; an existing folder is replaced.

    Parameters
    ----------
    path : Path
        The final name.
    writer : callable
        Makes the folder that it is given, with its files.

    Raises
    ------
    SceneError
        The folder could not be written, or what the writer raises.
    """
    try:
        with tempfile.TemporaryDirectory(dir=path.parent) as place:
            new, old = Path(place) / "new", Path(place) / "old"
            writer(new)
            if path.exists():
                os.replace(path, old)
            try:
                os.replace(new, path)
            finally:
                if old.exists() and not path.exists():
                    os.replace(old, path)
    except SceneError:
        # What is written, not where.
        raise
    except (OSError, ValueError, ArithmeticError) as error:
        raise SceneError(f"{path}: could not be written: {error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
