"""The files that a run writes: the answer as JSON, pictures, animations, files for ParaView; none half-written."""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .description.scene import Scene
from .errors import SceneError

__all__ = ["Output", "outputs_of"]

Writer = Callable[[Any, Path], Any]
"""What writes an answer to a file."""


@dataclass(frozen=True)
class Output:
    """A file that an option of the command line asks for.

    Attributes
    ----------
    option, path
    writer : callable
        Writes an answer to a path with the same ending.
    folder : bool
        It makes a new folder of files.
    """

    option: str
    path: Path
    writer: Writer
    folder: bool = False

    def write(self, answer: Any) -> None:
        """Write an answer.

        Raises
        ------
        SceneError
            It could not be written; what was there before is left.
        """
        if self.folder:
            _write_folder(self.path, lambda path: self.writer(answer, path))
        else:
            _write(self.path, lambda path: self.writer(answer, path))


def outputs_of(options: argparse.Namespace, scene: Scene) -> list[Output]:
    """What the options ask for, before anything is solved.

    Raises
    ------
    SceneError
        It cannot be written, or not of such a scene.
    """
    makers: dict[str, Callable[[Path, Scene], Writer]] = {"json": _json, "plot": _plot}
    found: list[Output] = []
    for key, maker in makers.items():
        path = getattr(options, key)
        if path is None:
            continue
        _check_writable(path)
        if path.exists() and path.samefile(options.file):
            raise SceneError(f"{path}: is the scene itself, accepted: another file")
        for other in found:
            if other.path.resolve() == path.resolve():
                raise SceneError(f"{path}: found for {other.option} and for --{key}, accepted: two files")
        found.append(Output(f"--{key}", path, maker(path, scene)))
    if options.matrices is not None:
        found.append(_matrices(options.matrices, scene))
    return found


def _matrices(path: Path, scene: Scene) -> Output:
    """Matrices of small motions, in one file or a folder of its own."""
    if scene.analysis.type != "modes":
        raise SceneError(f"--matrices: found the analysis {scene.analysis.type!r}, accepted: 'modes'")
    folder = path.suffix != ".npz"
    if folder and path.exists():
        raise SceneError(f"{path}: exists, accepted: a new folder, or a file that ends in .npz")
    if not folder:
        _check_writable(path)
    return Output("--matrices", path, lambda answer, there: answer.matrices().save(there), folder)


def _json(path: Path, scene: Scene) -> Writer:
    return lambda answer, there: there.write_text(json.dumps(answer.to_dict(), allow_nan=False) + "\n")


def _plot(path: Path, scene: Scene) -> Writer:
    # Matplotlib costs more than most solves: only a picture pays for it.
    from .pictures.charts import save_chart
    from .pictures.files import check_ending
    from .pictures.motions import save_motion
    from .pictures.plotting import save_picture

    _placed(path, lambda: check_ending(path))
    writers: dict[str, Writer] = {"path": save_chart, "dynamic": save_motion}
    return writers.get(scene.analysis.type, save_picture)


def _placed(path: Path, check: Callable[[], object]) -> None:
    """A check whose sentence begins with the file."""
    try:
        check()
    except SceneError as error:
        raise SceneError(str(error), (str(path),)) from None


def _check_writable(path: Path) -> None:
    try:
        plain = not path.is_symlink() and (path.is_file() or not path.exists())
        # What permissions say is not all: some folders take no files from anybody.
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except (OSError, ValueError):
        plain = False
    if not plain:
        accepted = "a plain file in a folder that exists and can be written"
        raise SceneError(f"{path}: cannot be written; accepted: {accepted}")


def _write(path: Path, writer: Callable[[Path], Any]) -> None:
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


def _write_folder(path: Path, writer: Callable[[Path], Any]) -> None:
    """The same for a folder of files, which must not be there yet."""
    try:
        with tempfile.TemporaryDirectory(dir=path.parent) as place:
            writer(Path(place) / path.name)
            os.replace(Path(place) / path.name, path)
    except (OSError, ValueError, ArithmeticError) as error:
        raise SceneError(f"{path}: could not be written: {error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
