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
"""Largest size of a manifest that is read, bytes."""

RESERVED = (
    " auto break case char const continue default do double else enum extern float for goto if inline int long "
    " register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
    " class namespace template this throw new delete public private protected virtual operator using bool true false "
    " main check sf casadi pythonfmu m test all clean install help "
    " ALL_BUILD INSTALL PACKAGE RUN_TESTS ZERO_CHECK package package_source preinstall edit_cache rebuild_cache depend "
    " complex fenv inttypes limits math setjmp stdarg stdbool stddef stdint stdio stdlib tgmath wchar wctype features "
)
"""Names that an export cannot have: words of C, C++ and CMake, files of the folder, headers that it would hide."""


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
        A new or empty folder, or with ``overwrite`` that of an earlier export.
    name : str
        Name of the files, and prefix of all names in C.
    arguments : names of numbers of the scene, or a mapping of them to their ranges (low, high)
        ``factor``, ``histories.NAME``, and any number or list of numbers: ``loads.tip.value``,
        ``sections.strip.EI3``.  Without them the factor, all loads and all motions.  A range limits what is accepted.
    results : names as in the JSON answer
        ``nodes.B.position``, ``reactions.A.force``, ``members.beam.moment``, ``springs.S.angle``,
        ``energy.elastic``, and ``stiffness.B`` or ``compliance.B``.  Without them all but these two.
    places : mapping of members to fractions of their length
        Where results along members are computed.
    sensitivities : bool
        Whether to add the derivatives of all results by all arguments.
    derivatives : bool
        Whether to write, instead of a solver, the nonlinear program: energy, constraints and their derivatives.
    settings : Settings, optional
        Accuracy, elements.
    overwrite : bool
        Whether to replace an earlier export in the folder.

    Returns
    -------
    EquilibriumSolver, TimeStep or Derivatives
        The functions of the export, for use in Python.

    Raises
    ------
    SceneError
        The scene or one of its numbers cannot be exported, options contradict each other, or the name or the folder
        cannot be used.

    Examples
    --------
    >>> export(scene, "tip", arguments=["loads.tip.value"])       # doctest: +SKIP
    """
    check_scene(scene, "export({}, ...)", steps=False)
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
    """The object that is exported, and the texts of its files by name."""
    made: EquilibriumSolver | TimeStep | Derivatives
    given: dict[str, Any] = {"arguments": arguments, "settings": settings}
    writer: Writer
    moving = scene.analysis.type == "dynamic"
    if (sensitivities or derivatives) and moving:
        raise SceneError("found a motion, accepted of an equilibrium only", ("sensitivities or derivatives",))
    if derivatives:
        if results or places or sensitivities:
            raise SceneError("found results, accepted: none, as a program has unknowns", ("derivatives",))
        for key, field in scene.fields.items():
            if field.table is not None and scene.magnets:
                message = "found a table, beyond whose end derivatives would go on, accepted: another type of field"
                raise SceneError(message, ("fields", key))
        made = program_of(scene, name, **given)
        writer = DerivativesWriter(made)
    elif moving:
        made = time_step(scene, name, results=results, places=places, **given)
        writer = StepWriter(made)
    else:
        given |= {"stopped": scene.stopped, "touching": True, "watched": True}
        made = equilibrium_solver(scene, name, results=results, places=places, **given)
        writer = EquilibriumWriter(made, sensitivities=sensitivities)
    return made, writer.files()


def check_name(name: str) -> None:
    """Refuse a name that cannot be the prefix of names in C and the name of a Python module.

    Raises
    ------
    SceneError
        It is no identifier, longer than 60 characters, begins as names inside do, or is a word of C or CMake or a
        module of Python.
    """
    plain = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII)
    # Constants begin with the name in capitals, what is inside with sf_; a loader may not hide what Python imports.
    taken = f" {name} " in RESERVED or name.lower() == "sf" or name.startswith("sf_") or name in sys.stdlib_module_names
    if not plain or taken or keyword.iskeyword(name) or len(name) > 60:
        accepted = (
            "a name of letters, digits and _ that begins with a letter, not with sf_, and is no word of C or CMake or"
            " module of Python"
        )
        raise SceneError(f"found {say(name)}, accepted: {accepted}", ("name",))


def check_folder(path: Path, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written, or holds anything but, with ``overwrite``, an earlier export.

    Raises
    ------
    SceneError
        It is such a folder, or its parent does not exist.
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
    """Whether all files of a folder are those of an earlier export or made from it."""
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
