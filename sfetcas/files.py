"""Files and folders that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .errors import SceneError

__all__ = ["write_file", "write_folder"]


def write_file(path: Path, writer: Callable[[Path], Any]) -> None:
    """Write beside the final name first, so that nothing half-written is ever seen."""
    name = ""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=path.suffix)
        os.close(handle)
        writer(Path(name))
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except (OSError, ValueError, ArithmeticError) as error:
        raise SceneError(f"{path}: could not be written: {error}") from None
    finally:
        if name:
            Path(name).unlink(missing_ok=True)


def write_folder(path: Path, writer: Callable[[Path], Any]) -> None:
    """Write a folder of files beside its final name first; it takes the place of one that is there."""
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
    except (OSError, ValueError, ArithmeticError) as error:
        raise SceneError(f"{path}: could not be written: {error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
