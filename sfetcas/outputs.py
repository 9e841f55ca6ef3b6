"""The files that a run writes: the answer as JSON, pictures, animations, files for ParaView; none half-written."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .checks import check
from .description.scene import Scene
from .equilibria.settings import Settings
from .errors import SceneError, Status
from .files import write_file, write_folder
from .reports import print_checks, report

if TYPE_CHECKING:
    from .tradeoff.trading import Trade

__all__ = ["Output", "outputs_of", "outputs_of_page", "outputs_of_sweep", "outputs_of_trade"]

Writer = Callable[[Any, Path], Any]
"""A function that writes an answer to a path."""


@dataclass(frozen=True)
class Output:
    """A file that an option of the command line asks for.

    Attributes
    ----------
    option : str
        The option, as ``--json``.
    path : Path
    writer : callable
        (answer, path) writes an answer to a path with the same ending.
    folder : bool
        Whether the path is a folder of files.
    """

    option: str
    path: Path
    writer: Writer
    folder: bool = False

    def write(self, answer: Any) -> None:
        """Write an answer, all of it or nothing.

        Raises
        ------
        SceneError
            It could not be written; an earlier file or folder is left as it was.
        """
        if self.folder:
            write_folder(self.path, lambda path: self.writer(answer, path))
        else:
            write_file(self.path, lambda path: self.writer(answer, path))


def outputs_of(options: argparse.Namespace, scene: Scene) -> list[Output]:
    """The files that the options of a run ask for, checked before anything is solved.

    Raises
    ------
    SceneError
        A path cannot be written, or there is no such output for this type of analysis.
    """
    _check_drawn(options, scene)
    makers: dict[str, Callable[[Path, Scene], Writer]] = {
        "json": _json,
        "plot": lambda path, scene: _plot(path, scene, options.colour, options.quantity),
        "animate": lambda path, scene: _animate(path, scene, options.colour),
        "vtk": _vtk,
    }
    found: list[Output] = []
    for key, maker in makers.items():
        path = getattr(options, key)
        if path is None:
            continue
        (_check_folder if key == "vtk" else _check_writable)(path)
        if path.exists() and path.samefile(options.file):
            raise SceneError(f"{path}: is the scene itself, accepted: another file")
        for other in found:
            if other.path.resolve() == path.resolve():
                raise SceneError(f"{path}: found for {other.option} and for --{key}, accepted: two files")
        found.append(Output(f"--{key}", path, maker(path, scene), key == "vtk"))
    if options.matrices is not None:
        found.append(_matrices(options.matrices, scene))
    return found


def outputs_of_page(
    options: argparse.Namespace,
    scene: Scene,
    arguments: Mapping[str, tuple[float, float] | None] | None,
    settings: Settings,
) -> list[Output]:
    """The page that is asked for, checked before anything is solved; ``arguments`` and ``settings`` are those of the
    solver of a live one.

    Raises
    ------
    SceneError
        Its ending is no page's, it cannot be written, or is the scene itself; no live page shows the scene.
    """
    from .pages.live import check_ahead, check_live
    from .pages.page import ENDINGS, page_of
    from .pictures.files import check_ending

    path = options.page
    _placed(path, lambda: check_ending(path, ENDINGS, "a page"))
    _check_writable(path)
    if path.exists() and path.samefile(options.file):
        raise SceneError(f"{path}: is the scene itself, accepted: another file")
    if options.live:
        _placed("--live", lambda: check_live(scene))
        check_ahead(scene, arguments, settings)
    elif arguments is not None:
        raise SceneError("--argument: found without effect, accepted: with --live")
    source = options.file.read_text(encoding="utf-8")

    def write(answer: Any, there: Path) -> None:
        with contextlib.redirect_stdout(io.StringIO()) as said:
            report(answer, sum(answer.seconds.values()))
            if answer.status is Status.SOLVED:
                print_checks(check(scene, answer))
        how: dict[str, Any] = {"live": options.live, "arguments": arguments, "settings": settings}
        page = page_of(answer, source, said.getvalue(), **how)
        there.write_text(page, encoding="utf-8")

    return [Output("OUT.html", path, write)]


def outputs_of_trade(options: argparse.Namespace) -> list[Output]:
    """The files that the options of a trade ask for, checked before anything is run.

    Raises
    ------
    SceneError
        A path cannot be written, is the scene itself, or is given twice.
    """
    from .tradeoff.tables import as_csv, as_json, as_markdown

    texts: dict[str, Callable[[Trade], str]] = {"markdown": as_markdown, "csv": as_csv, "json": as_json}
    found: list[Output] = []
    for key in (*texts, "plot"):
        path = getattr(options, key)
        if path is None:
            continue
        _check_writable(path)
        if path.exists() and path.samefile(options.file):
            raise SceneError(f"{path}: is the scene itself, accepted: another file")
        if any(other.path.resolve() == path.resolve() for other in found):
            raise SceneError(f"{path}: found twice, accepted: different files")
        writer = _front(path) if key == "plot" else _text(texts[key])
        found.append(Output(f"--{key}", path, writer))
    return found


def outputs_of_sweep(options: argparse.Namespace) -> list[Output]:
    """The tables that the options of a sweep ask for, checked before anything is run.

    Raises
    ------
    SceneError
        A path cannot be written, is an input of the sweep, or is given twice.
    """
    from .sweeps.result import check_table

    found: list[Output] = []
    for path in options.out:
        check_table(path)
        _check_writable(path)
        if path.exists() and any(other is not None and path.samefile(other) for other in (options.file, options.cases)):
            raise SceneError(f"{path}: is what is read, accepted: another file")
        if any(other.path.resolve() == path.resolve() for other in found):
            raise SceneError(f"{path}: found twice, accepted: different files")
        found.append(Output("--out", path, lambda answer, there: answer.write(there)))
    return found


def _text(text_of: Callable[[Trade], str]) -> Writer:
    return lambda trade, there: there.write_text(text_of(trade))


def _front(path: Path) -> Writer:
    from .pictures.files import check_ending
    from .pictures.fronts import save_front

    _placed(path, lambda: check_ending(path))
    return save_front


def _matrices(path: Path, scene: Scene) -> Output:
    """Output of the matrices of small motions, in a file ``.npz`` or a new folder."""
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


def _check_drawn(options: argparse.Namespace, scene: Scene) -> None:
    """Refuse what is said of pictures where it changes none that is asked for."""
    kind = scene.analysis.type
    if options.quantity and (options.plot is None or kind == "modes"):
        raise SceneError("--quantity: found without effect, accepted: with --plot of steps, of a path or of a motion")
    if options.colour is None:
        return
    if options.plot is not None and options.quantity and options.animate is None:
        raise SceneError("--colour: found with --quantity, accepted: one of them, as curves have no such colours")
    drawn = (options.plot is not None and kind == "static") or (options.animate is not None and kind != "modes")
    if not drawn:
        accepted = "with --plot of equilibria, or with --animate of steps, a path or a motion"
        raise SceneError(f"--colour: found without effect, accepted: {accepted}")


def _plot(path: Path, scene: Scene, colour: str | None, quantities: list[str] | None) -> Writer:
    # Matplotlib costs more than most solves: only a picture pays for it.
    from .pictures.charts import save_chart
    from .pictures.colours import coloured
    from .pictures.curves import quantities_named, save_curves
    from .pictures.files import check_ending
    from .pictures.modeshapes import save_modes
    from .pictures.motions import save_motion
    from .pictures.plotting import save_picture

    _placed(path, lambda: check_ending(path))
    kind = scene.analysis.type
    if quantities:
        _placed("--quantity", lambda: quantities_named(scene, quantities))
        writers: dict[str, Callable[..., Any]] = {"path": save_chart, "dynamic": save_motion, "static": save_curves}
        return lambda answer, there: writers[kind](answer, there, quantities=quantities)
    if kind == "static" and colour is not None:
        _placed("--colour", lambda: coloured(scene, colour))
        return lambda answer, there: save_picture(answer, there, colour=colour)
    usual: dict[str, Writer] = {"path": save_chart, "dynamic": save_motion, "modes": save_modes}
    return usual.get(kind, save_picture)


def _animate(path: Path, scene: Scene, colour: str | None) -> Writer:
    from .pictures.animation import check_animation, save_animation
    from .pictures.colours import NONE, coloured

    _placed(path, lambda: check_animation(scene, path))
    _placed("--colour", lambda: coloured(scene, colour or NONE))
    return lambda answer, there: save_animation(answer, there, colour=colour or NONE)


def _vtk(path: Path, scene: Scene) -> Writer:
    try:
        from .pictures.paraview import save_vtk
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "pyevtk":
            raise
        message = "found no library pyevtk, which writes such files, accepted: after pip install 'sfetcas[vtk]'"
        raise SceneError(message, ("--vtk",)) from None
    return save_vtk


def _placed(place: Path | str, check: Callable[[], object]) -> None:
    """Do a check, with the file or the option at the beginning of the message if it fails."""
    try:
        check()
    except SceneError as error:
        raise SceneError(str(error) if isinstance(place, Path) else error.bare, (str(place),)) from None


def _check_writable(path: Path) -> None:
    try:
        plain = not path.is_symlink() and (path.is_file() or not path.exists())
        # Permissions alone do not decide: some folders accept no files from anybody.
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except (OSError, ValueError):
        plain = False
    if not plain:
        accepted = "a plain file in a folder that exists and can be written"
        raise SceneError(f"{path}: cannot be written; accepted: {accepted}")


OURS = re.compile(r"answers\.pvd|answer_\d+\.vtu")
"""Names of the files of an earlier run in a folder, which a later one replaces."""


def _check_folder(path: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
        ours = not path.is_symlink() and (not path.exists() or all(OURS.fullmatch(name) for name in os.listdir(path)))
    except (OSError, ValueError):
        ours = False
    if not ours:
        accepted = "a new folder, or one that is empty or has nothing but files of an earlier run"
        raise SceneError(f"{path}: cannot be written; accepted: {accepted}")
