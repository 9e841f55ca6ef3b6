"""Writing matplotlib figures to files, in the format of their ending."""

from __future__ import annotations

import io
import os
from pathlib import Path

from matplotlib.figure import Figure

from ..errors import SceneError

__all__ = ["DPI", "ENDINGS", "check_ending", "save_figure"]

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


def save_figure(figure: Figure, file: str | os.PathLike[str]) -> None:
    """Write a figure in the format of the ending of the file, without the date.

    Raises
    ------
    SceneError
        The ending is none of :data:`ENDINGS`.
    """
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    content, ending = io.BytesIO(), check_ending(file)
    # Libraries that write files by themselves do not all say where a disk is full.
    figure.savefig(content, format=ending[1:], dpi=DPI, metadata=dates.get(ending))
    Path(file).write_bytes(content.getvalue())
