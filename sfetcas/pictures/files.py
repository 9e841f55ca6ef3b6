"""Writing matplotlib figures to files, in the format of their ending."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SceneError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DPI", "ENDINGS", "check_ending", "check_folder", "save_figure"]

DPI = 150
ENDINGS = (".pdf", ".png", ".svg", ".jpg", ".jpeg", ".webp")
"""Endings of the files that pictures are written to."""


def check_ending(file: str | os.PathLike[str], accepted: tuple[str, ...] = ENDINGS, kind: str = "a picture") -> str:
    """The ending of a file, in small letters.

    Raises
    ------
    SceneError
        It is none of the accepted ones.
    """
    ending = Path(file).suffix.lower()
    if ending not in accepted:
        found = f"found the ending {ending!r}" if ending else "found no ending"
        raise SceneError(f"{found} of {kind}, accepted: {', '.join(accepted)}")
    return ending


def check_folder(file: str | os.PathLike[str]) -> None:
    """Refuse a file in a folder that does not exist.

    Raises
    ------
    SceneError
        There is no such folder.
    """
    folder = Path(file).parent
    if not folder.is_dir():
        raise SceneError(f"{file}: found no folder {folder}, accepted: a file in a folder that exists")


def save_figure(figure: Figure, file: str | os.PathLike[str]) -> None:
    """Write a figure in the format of the ending of the file, without the date.

    Raises
    ------
    SceneError
        The ending is none of :data:`ENDINGS`, or there is no such folder.
    """
    check_folder(file)
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    content, ending = io.BytesIO(), check_ending(file)
    # Libraries that write files by themselves do not all say where a disk is full.
    figure.savefig(content, format=ending[1:], dpi=DPI, metadata=dates.get(ending))
    Path(file).write_bytes(content.getvalue())
