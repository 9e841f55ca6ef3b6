"""The folder of generated C: sources, manifest, build files, example, check, loader, README."""

from __future__ import annotations

import json
import keyword
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..description.records import say
from ..description.scene import Scene, check_scene
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..files import read_file, write_folder
from ..mathematics.kernels import interpreted
from ..parametric.arguments import Asked
from ..parametric.equilibrium import EquilibriumSolver, Place, equilibrium_solver
from .derivatives import Derivatives
from .derivatives import derivatives as program_of
from .rendering import Writer
from .timestep import TimeStep, time_step
from .writing_derivatives import DerivativesWriter
from .writing_equilibria import EquilibriumWriter
from .writing_steps import StepWriter

__all__ = ["check_folder", "check_name", "export"]

LARGEST = 100_000_000
"""Bytes of a manifest that is looked at."""

RESERVED = (
    " auto break case char const continue default do double else enum extern float for goto if inline int long "
    " register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
    " class namespace template this throw new delete public private protected virtual operator using bool true false "
    " main check sf casadi pythonfmu m test all clean install help "
    " ALL_BUILD INSTALL PACKAGE RUN_TESTS ZERO_CHECK package package_source preinstall edit_cache rebuild_cache depend "
    " complex fenv inttypes limits math setjmp stdarg stdbool stddef stdint stdio stdlib tgmath wchar wctype features "
)
"""Words that are no names in C, in C++ or of targets of CMake, files of the folder, and what its own would hide."""


def export(
    scene: Scene,
    folder: str | Path,
    *,
    name: str = "structure",
    arguments: Asked = None,
    results: Sequence[str] | None = None,
    places: Place | None = None,
    sensitivities: bool = False,
    derivatives: bool = False,
    settings: Settings | None = None,
    overwrite: bool = False,
) -> EquilibriumSolver | TimeStep | Derivatives:
    """Write an equilibrium solver of a scene, or the time step of a motion, as C99 without dependencies.

    Parameters
    ----------
    scene : Scene
    folder : path
        Made anew.
    name : str
        Of the files, and the beginning of all names in C.
    arguments : names of numbers of the scene, or a mapping of them to their ranges (low, high)
        ``factor``, ``histories.NAME``, and any number or list of numbers: ``loads.tip.value``,
        ``sections.strip.EI3``.  Without them the factor, all loads and all motions.  A range limits what is accepted.
    results : names as in the JSON answer
        ``nodes.B.position``, ``reactions.A.force``, ``members.beam.moment``, ``springs.S.angle``,
        ``energy.elastic``, and ``stiffness.B`` or ``compliance.B``.  Without them all but these two.
    places : mapping of members to fractions of their length
        Where they are told of.
    sensitivities : bool
        Derivatives of all results by all arguments, too.
    derivatives : bool
        Instead of a solver energy, constraints and their derivatives: the nonlinear program of the equilibrium.
    settings : Settings, optional
        Accuracy, elements.
    overwrite : bool
        Replace what an existing folder holds.

    Returns
    -------
    EquilibriumSolver, TimeStep or Derivatives
        The same in process.

    Raises
    ------
    SceneError
        A scene or a number that cannot be exported; a folder that is there.

    Example
    -------
    >>> export(scene, "tip", arguments=["loads.tip.value"])       # doctest: +SKIP
    """
    check_scene(scene, "export({}, ...)")
    path = Path(folder)
    check_name(name)
    check_folder(path, overwrite=overwrite)
    with interpreted():
        made, files = _made(scene, name, arguments, results, places, settings, sensitivities, derivatives)

    def write(place: Path) -> None:
        place.mkdir()
        for file, text in files.items():
            (place / file).write_text(text, encoding="utf-8")

    write_folder(path, write)
    return made


def _made(
    scene: Scene,
    name: str,
    arguments: Asked,
    results: Sequence[str] | None,
    places: Place | None,
    settings: Settings | None,
    sensitivities: bool,
    derivatives: bool,
) -> tuple[EquilibriumSolver | TimeStep | Derivatives, dict[str, str]]:
    """What is exported, and its files."""
    made: EquilibriumSolver | TimeStep | Derivatives
    given: dict[str, Any] = {"arguments": arguments, "settings": settings}
    writer: Writer
    moving = scene.analysis.type == "dynamic"
    if (sensitivities or derivatives) and moving:
        raise SceneError("found a motion, accepted of an equilibrium only", ("sensitivities or derivatives",))
    if derivatives:
        if results or places or sensitivities:
            raise SceneError("found results, accepted: none, as a program has unknowns", ("derivatives",))
        made = program_of(scene, name, **given)
        writer = DerivativesWriter(made)
    elif moving:
        made = time_step(scene, name, results=results, places=places, **given)
        writer = StepWriter(made)
    else:
        made = equilibrium_solver(scene, name, results=results, places=places, **given)
        writer = EquilibriumWriter(made, sensitivities=sensitivities)
    return made, writer.files()


def check_name(name: str) -> None:
    """Refuse what is no name in C.

    Raises
    ------
    SceneError
        Says so.
    """
    plain = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII)
    # Constants begin with the name in capitals; a loader may not hide what Python itself imports.
    taken = f" {name} " in RESERVED or name.lower() == "sf" or name in sys.stdlib_module_names
    if not plain or taken or keyword.iskeyword(name) or len(name) > 60:
        accepted = (
            "a name of letters, digits and _ that begins with a letter and is no word of C or CMake or module of Python"
        )
        raise SceneError(f"found {say(name)}, accepted: {accepted}", ("name",))


def check_folder(path: Path, *, overwrite: bool) -> None:
    """Refuse a folder that holds anything.

    Raises
    ------
    SceneError
        Says so.
    """
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise SceneError(f"{path}: is no folder, accepted: a new folder")
    if not path.parent.is_dir():
        raise SceneError(f"{path}: found no folder {path.parent}, accepted: a new folder in one that exists")
    if path.exists() and any(path.iterdir()) and not overwrite:
        raise SceneError(f"{path}: exists and is not empty, accepted: a new folder, or to overwrite it (--overwrite)")
    if overwrite and path.exists() and any(path.iterdir()) and not _ours(path):
        raise SceneError(f"{path}: holds other things than an earlier export, accepted: to overwrite one")


def _ours(path: Path) -> bool:
    """Whether all that a folder holds is an earlier export, built or not."""
    try:
        manifest = json.loads(read_file(path / "manifest.json", LARGEST))
        name = manifest["name"] if manifest["made_by"] == "sfetcas" else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return False
    if not isinstance(name, str):
        return False
    known = {"manifest.json", "main.c", "check.c", "Makefile", "CMakeLists.txt", "README.md", "main", "build"}
    known |= {f"check_{name}", "__pycache__", f"lib{name}.so", f"lib{name}.dylib", f"{name}.dll"}
    known |= {f"{name}_unit.py"} | {entry.name for entry in path.glob("*Unit.fmu")}
    known |= {f"{name}.{ending}" for ending in ("c", "h", "o", "py")}
    return all(entry.name in known for entry in path.iterdir())
