"""The folder of generated C: solver, manifest, build files, example, check, loader, README."""

from __future__ import annotations

import json
import keyword
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..description.records import counted
from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..files import write_folder
from ..mathematics.arrays import Array
from ..solvers.globalised import MEANINGS, Code
from .equilibrium import EquilibriumSolver, Place, equilibrium_solver
from .rendering import constants, filled, identifiers, solver_files, template

__all__ = ["check_folder", "check_name", "export"]

RESERVED = (
    " auto break case char const continue default do double else enum extern float for goto if inline int long "
    " register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while "
    " class namespace template this throw new delete public private protected virtual operator using bool true false "
    " main check "
)
"""Words that are no names in C or C++, and names of files of the folder."""


def export(
    scene: Scene,
    folder: str | Path,
    *,
    name: str = "structure",
    arguments: Sequence[str] | Mapping[str, tuple[float, float] | None] | None = None,
    results: Sequence[str] | None = None,
    places: Place | None = None,
    sensitivities: bool = False,
    settings: Settings | None = None,
    overwrite: bool = False,
) -> EquilibriumSolver:
    """Write an equilibrium solver of a scene as C99 without dependencies.

    Parameters
    ----------
    scene : Scene
    folder : path
        Made anew.
    name : str
        Of the files, and the beginning of all names in C.
    arguments : names of numbers of the scene, or a mapping of them to their ranges (low, high)
        ``factor``, ``histories.NAME``, and any number or list of numbers: ``loads.tip.value``,
        ``sections.strip.EI3``.  Without them the factor, all loads and all motions.  A range is needed by what enters
        the model by no power, as positions of nodes.
    results : names as in the JSON answer
        ``nodes.B.position``, ``reactions.A.force``, ``members.beam.moment``, ``springs.S.angle``,
        ``energy.elastic``, and ``stiffness.B`` or ``compliance.B``.  Without them all but these two.
    places : mapping of members to fractions of their length
        Where they are told of.
    sensitivities : bool
        Derivatives of all results by all arguments, too.
    settings : Settings, optional
        Accuracy, elements.
    overwrite : bool
        Replace what an existing folder holds.

    Returns
    -------
    EquilibriumSolver
        The same solver in process.

    Raises
    ------
    SceneError
        A scene or a number that cannot be exported; a folder that is there.

    Example
    -------
    >>> export(scene, "tip", arguments=["loads.tip.value"])       # doctest: +SKIP
    """
    path = Path(folder)
    check_name(name)
    check_folder(path, overwrite=overwrite)
    solver = equilibrium_solver(scene, name, arguments=arguments, results=results, places=places, settings=settings)
    files = _files(solver, sensitivities)

    def write(place: Path) -> None:
        place.mkdir()
        for file, text in files.items():
            (place / file).write_text(text, encoding="utf-8")

    write_folder(path, write)
    return solver


def check_name(name: str) -> None:
    """Refuse what is no name in C.

    Raises
    ------
    SceneError
        Says so.
    """
    plain = re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII)
    if not plain or f" {name} " in RESERVED or keyword.iskeyword(name) or len(name) > 60:
        accepted = "a name of letters, digits and _ that begins with a letter and is no word of C"
        raise SceneError(f"found {name!r}, accepted: {accepted}", ("name",))


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
        raise SceneError(f"{path}: exists and is not empty, accepted: a new folder, or to overwrite it")
    if overwrite and path.exists() and any(path.iterdir()) and not (path / "manifest.json").is_file():
        raise SceneError(f"{path}: holds no earlier export, accepted: to overwrite one")


def _files(solver: EquilibriumSolver, sensitivities: bool) -> dict[str, str]:
    files = solver_files(solver, sensitivities=sensitivities)
    manifest = _manifest(solver, sensitivities)
    values = {**constants(solver), **_cases(solver), **_words(solver, manifest)}
    return {
        **files,
        "manifest.json": json.dumps(manifest, indent=1) + "\n",
        "main.c": filled(template("main.c"), values),
        "check.c": filled(template("check.c"), values),
        f"{solver.name}.py": filled(template("loader.py.in"), values),
        "Makefile": filled(template("Makefile"), values),
        "CMakeLists.txt": filled(template("CMakeLists.txt"), values),
        "README.md": filled(template("README.md"), values),
    }


def _manifest(solver: EquilibriumSolver, sensitivities: bool) -> dict[str, Any]:
    """What every argument and result is."""
    known, told = solver.arguments.arguments, solver.results.results
    arguments, first = [], 0
    for identifier, one in zip(identifiers(a.name for a in known), known, strict=True):
        entry: dict[str, Any] = {"name": one.name, "constant": f"{solver.name.upper()}_ARG_{identifier}"}
        entry |= {"first": first, "size": len(one.default), "unit": one.unit, "meaning": one.meaning}
        entry["default"] = one.default[0] if one.components is None else list(one.default)
        if one.components is not None:
            entry["components"] = list(one.components)
        if one.low is not None:
            entry["range"] = [one.low, one.high]
        arguments.append(entry)
        first += len(one.default)
    results, first = [], 0
    for identifier, result in zip(identifiers(r.name for r in told), told, strict=True):
        entry = {"name": result.name, "constant": f"{solver.name.upper()}_RES_{identifier}", "first": first}
        entry |= {"size": result.size, "shape": list(result.shape), "unit": result.unit, "meaning": result.meaning}
        member = result.name.split(".")[1] if result.name.startswith("members.") else None
        if member is not None:
            entry["s"] = list(solver.results.places[member])
        results.append(entry)
        first += result.size
    program = solver.arguments.program
    return {
        "name": solver.name,
        "title": solver.scene.title,
        "made_by": "sfetcas",
        "language": "C99",
        "dimension": solver.model.dimension,
        "elements": solver.model.mesh.elements,
        "element": solver.model.element.name,
        "unknowns": program.expressions.total,
        "error_estimate": solver.answer.certificate.error_estimate,
        "functions": ["solve", "defaults", "message", *(["sensitivities"] if sensitivities else [])],
        "sizes": {
            "arguments": len(solver.arguments.defaults),
            "results": solver.results.size,
            "state": program.states,
            "memory_bytes": memory_bytes(solver, sensitivities),
        },
        "arguments": arguments,
        "results": results,
        "statuses": {code.name: {"value": int(code), "meaning": MEANINGS[code]} for code in Code},
    }


def memory_bytes(solver: EquilibriumSolver, sensitivities: bool) -> int:
    """An upper bound of the memory of a solve, where pointers take eight bytes."""
    sizes = constants(solver, sensitivities)

    def of(key: str) -> int:
        return int(str(sizes[f"sz_{key}"]))

    doubles = of("w") + 2 * of("given") + 4 * of("state") + 8 * of("total") + 5 * of("entries") + of("lower")
    return 8 * (doubles + of("arg") + of("res")) + 4 * (of("iw") + 1)


def _cases(solver: EquilibriumSolver) -> dict[str, object]:
    """Arguments, statuses and results of a few solves in process."""
    base = solver.arguments.defaults
    cases = [base]
    for step in solver.scene.analysis.steps[:-1][:4]:
        cases.append(np.array([step if n == "factor" else x for n, x in _named(solver)]))
    # Neighbours of the scene, within the ranges.
    for shift in (0.03, -0.07):
        cases.append(np.array([_shifted(solver, i, x, shift) for i, (_, x) in enumerate(_named(solver))]))
    solved = [solver.solve(case) for case in cases]
    results = [result for _, result in solved]
    units = np.ones(solver.results.size)
    first = 0
    largest: dict[str, float] = {}
    for one in solver.results.results:
        values = np.abs([r[first : first + one.size] for r in results])
        kind = one.name.rpartition(".")[2] if "." in one.name else one.name
        kind = one.name if one.name.startswith(("stiffness", "compliance")) else kind
        values = values[np.isfinite(values)]
        largest[kind] = max(largest.get(kind, 0.0), float(values.max(initial=0.0)))
        first += one.size
    first = 0
    for one in solver.results.results:
        kind = one.name.rpartition(".")[2]
        kind = one.name if one.name.startswith(("stiffness", "compliance")) else kind
        units[first : first + one.size] = largest[kind] or 1.0
        first += one.size
    return {
        "n_cases": len(cases),
        "case_statuses": ", ".join(str(int(outcome.code)) for outcome, _ in solved),
        "sz_p": max(1, len(base)),
        "sz_r": max(1, solver.results.size),
        "case_arguments": _rows(cases),
        "case_results": _rows(results),
        "units": _row(units),
    }


def _named(solver: EquilibriumSolver) -> list[tuple[str, float]]:
    return [(n, x) for one in solver.arguments.arguments for n, x in zip(one.names, one.default, strict=True)]


def _shifted(solver: EquilibriumSolver, i: int, value: float, share: float) -> float:
    """A neighbouring value of an argument, within its range."""
    spans = [(one.low, one.high) for one in solver.arguments.arguments for _ in one.default]
    low, high = spans[i]
    moved = value * (1.0 + share)
    return float(np.clip(moved, low, high)) if low is not None and high is not None else moved


def _row(values: Array) -> str:
    texts = [repr(float(x)) if np.isfinite(x) else "0.0" for x in values] or ["0.0"]
    lines = [", ".join(texts[i : i + 5]) for i in range(0, len(texts), 5)]
    return ",\n   ".join(lines)


def _rows(rows: Sequence[Array]) -> str:
    return ",\n".join(f"  {{{_row(row)}}}" for row in rows)


def _words(solver: EquilibriumSolver, manifest: Mapping[str, Any]) -> dict[str, object]:
    """Tables of the README and of the example."""
    model, arguments, results = solver.model, manifest["arguments"], manifest["results"]
    started = solver.start is not None
    flexible = counted(model.mesh.elements, f"{model.element.name} element")
    example = arguments[0] if arguments else None
    name = "" if example is None else example["name"] + ("" if example["size"] == 1 else ".0")
    return {
        "model_in_words": f"In {'the plane' if model.dimension == 'plane' else 'space'}: {flexible}, "
        f"{counted(manifest['unknowns'], 'unknown')}.",
        "start_in_words": "a bent state near that of the scene" if started else "the undeformed structure",
        "memory_kb": manifest["sizes"]["memory_bytes"] // 1000 + 1,
        "first_argument": f"{name}=1.5" if example else "",
        "first_result": results[0]["name"] if results else "message",
        "argument_entries": "\n".join(_entry(one) for one in arguments),
        "result_entries": "\n".join(_entry(one) for one in results),
        "argument_rows": "\n".join(
            f"| `{one['name']}` | {one['size']} | {one['unit']} | {_short(one['default'])} | {one['meaning']} |"
            for one in arguments
        ),
        "result_rows": "\n".join(
            f"| `{one['name']}` | {' x '.join(map(str, one['shape'])) or '1'} | {one['unit']} | {one['meaning']} |"
            for one in results
        ),
        "status_rows": "\n".join(f"| {code.name} = {int(code)} | {MEANINGS[code]} |" for code in Code),
    }


def _entry(one: Mapping[str, Any]) -> str:
    return f"  {{{json.dumps(one['name'])}, {one['first']}, {one['size']}, {json.dumps(one['unit'])}}},"


def _short(value: float | list[float]) -> str:
    return ", ".join(f"{x:.6g}" for x in value) if isinstance(value, list) else f"{value:.6g}"
