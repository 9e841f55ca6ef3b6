"""What the gallery says of a problem file: solved, compared with what is known of it, drawn, and on a page that turns.

A problem is solved and drawn again only after it, the program or a library has changed; what was made of it is kept in
``docs/gallery``, where the test of the problems finds it, too.  As a program this makes the entries of all scenes but
live ones, one after the other.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import importlib.util
import inspect
import io
import json
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from sfetcas import Modes, Scene, load, solve
from sfetcas.checks import check
from sfetcas.description.records import say
from sfetcas.errors import SceneError, SolveError
from sfetcas.pages.page import page_of
from sfetcas.reports import report

ROOT = Path(__file__).resolve().parents[2]
PROBLEMS = ROOT / "problems"
GALLERY = ROOT / "docs" / "gallery"
PICTURES = GALLERY / "pictures"
TURNING = GALLERY / "turning"
KEPT = GALLERY / "kept"
DPI = 110

MOST_STATES = 60
"""Of a path or a motion on a page that turns."""

LIVE = (
    "arch_120_degrees_crown_load",
    "bend_45_degrees",
    "flexible_parallelogram_motion",
    "lee_frame",
    "magnetic_gripper",
    "pendulum_in_space",
    "slider_crank_motion",
    "spatial_fourbar",
    "tendon_finger",
    "tube_robot",
)
"""Scenes whose page has the solver itself."""


@dataclass(frozen=True)
class Comparison:
    """An expected value beside what was found, as text, and whether it is within its tolerance."""

    quantity: str
    expected: str
    found: str
    difference: float
    tolerance: str
    reason: str
    passed: bool


@dataclass(frozen=True)
class Entry:
    """What a page of the gallery says of a problem."""

    name: str
    title: str
    group: str
    source: str
    text: str
    command: str
    found: str
    comparisons: list[Comparison]
    seconds: float
    picture: bool


def problems() -> list[Path]:
    """All problem files, scenes and programs."""
    return sorted([*PROBLEMS.glob("*.toml"), *PROBLEMS.glob("*.py")])


def entry_of(file: Path) -> Entry:
    """Solve, check and draw a problem.

    Raises
    ------
    SceneError, SolveError
        It cannot be solved.
    """
    for folder in (PICTURES, TURNING):
        folder.mkdir(parents=True, exist_ok=True)
    return _of_program(file) if file.suffix == ".py" else _of_scene(file)


def _of_scene(file: Path) -> Entry:
    begun, scene, said = time.perf_counter(), load(file), io.StringIO()
    answer = solve(scene)
    seconds = time.perf_counter() - begun
    with contextlib.redirect_stdout(said):
        report(answer, seconds)
    comparisons = [
        Comparison(
            # What chooses an answer stands behind the name, as in the file's own words.
            quantity=" ".join([entry.expect.quantity, *_choice(entry.expect)]),
            expected=_rounded(entry.expect.value),
            found=_rounded(entry.value),
            difference=entry.error,
            tolerance="exactly" if entry.expect.tolerance is None else f"{entry.expect.tolerance:.1e}",
            reason="; ".join(filter(None, (entry.expect.why, entry.expect.source))),
            passed=entry.passed,
        )
        for entry in check(scene, answer)
    ]
    figure = answer.plot()
    if not isinstance(answer, Modes):
        # All its parts have their places.
        figure.set_layout_engine("none")
    _save(figure, file)
    found = said.getvalue()
    _turn(answer, file, file.read_text(encoding="utf-8"), found)
    title = scene.title or file.stem
    command = f"sfetcas run problems/{file.name} --plot {file.stem}.png"
    return Entry(
        file.stem,
        title,
        _group(scene),
        scene.source,
        "",
        command,
        found,
        comparisons,
        seconds,
        picture=True,
    )


def _save(figure: Figure, file: Path) -> None:
    figure.savefig(PICTURES / f"{file.stem}.png", dpi=DPI)
    plt.close(figure)


def _turn(answer: Any, file: Path, source: str, said: str | None = None) -> None:
    live = file.stem in LIVE
    text = page_of(answer, source, said, live=live, most=MOST_STATES)
    (TURNING / f"{file.stem}.html").write_text(text, encoding="utf-8")


def _choice(expect: Any) -> Iterator[str]:
    places = ("at", "step", "time", "equilibrium", "crossing")
    for key in (*places, "limit_point", "bifurcation", "flutter_point", "transition"):
        if getattr(expect, key) is not None:
            yield f"{key} {getattr(expect, key):g}"


def _rounded(value: Any) -> str:
    if isinstance(value, bool | str):
        return say(value)
    if isinstance(value, list | tuple) or hasattr(value, "tolist"):
        return f"[{', '.join(map(_rounded, value))}]"
    return f"{value:.9g}"


def _group(scene: Scene) -> str:
    if scene.analysis.type == "static":
        plane = scene.resolved_dimension == "plane"
        return "Contact" if scene.contacts else f"Statics in {'the plane' if plane else 'space'}"
    return {"path": "Paths and stability", "modes": "Vibrations", "dynamic": "Motion"}[scene.analysis.type]


def _of_program(file: Path) -> Entry:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    begun = time.perf_counter()
    differences = module.check()
    seconds = time.perf_counter() - begun
    comparisons = [
        Comparison(name, "", "", float(value), f"{module.TOLERANCE:.1e}", "", bool(value <= module.TOLERANCE))
        for name, value in differences.items()
    ]
    # Of what was checked, where the size of it is a choice: it is at hand.
    sizes = {name: entry.default for name, entry in inspect.signature(module.check).parameters.items()}

    def sized(function: Any) -> Any:
        taken = inspect.signature(function).parameters
        return function(**{name: size for name, size in sizes.items() if name in taken})

    drawn = hasattr(module, "picture")
    if drawn:
        _save(sized(module.picture), file)
    _turn(sized(module.answer), file, file.read_text(encoding="utf-8"))
    title, _, text = (module.__doc__ or file.stem).partition("\n")
    command = f"python problems/{file.name}"
    return Entry(
        *(file.stem, title.rstrip("."), "Programs", "", text.strip(), command, "", comparisons, seconds),
        picture=drawn,
    )


# -- what was made before -------------------------------------------------------------------------------


def program_digest() -> str:
    """A digest of the program, of this module, and of the versions of what they are run with."""
    versions = (sys.version, *(importlib.metadata.version(name) for name in ("casadi", "matplotlib", "numpy", "scipy")))
    digest = hashlib.sha256(repr(versions).encode())
    parts = [one for ending in ("py", "js", "css", "html", "c", "h") for one in (ROOT / "sfetcas").rglob(f"*.{ending}")]
    for file in sorted([*parts, Path(__file__)]):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def kept(file: Path, program: str) -> Entry | None:
    """The entry that was made of a problem as it stands, by this program (its digest)."""
    try:
        found = json.loads((KEPT / f"{file.name}.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    # What another program has made may have other keys.
    if found["digest"] != _digest(file, program):
        return None
    comparisons = [Comparison(**comparison) for comparison in found["entry"]["comparisons"]]
    entry = Entry(**{**found["entry"], "comparisons": comparisons})
    there = (TURNING / f"{file.stem}.html").exists()
    there = there and (not entry.picture or (PICTURES / f"{file.stem}.png").exists())
    return entry if there else None


def made(file: Path, program: str) -> Entry:
    """The entry of a problem, made anew where the problem or the program (its digest) is another than before."""
    entry = kept(file, program)
    if entry is None:
        entry = entry_of(file)
        KEPT.mkdir(parents=True, exist_ok=True)
        # Whoever reads meanwhile finds all of it or nothing.
        part = KEPT / f"{file.name}.{os.getpid()}"
        part.write_text(json.dumps({"digest": _digest(file, program), "entry": asdict(entry)}), encoding="utf-8")
        part.replace(KEPT / f"{file.name}.json")
    return entry


def _digest(file: Path, program: str) -> str:
    return hashlib.sha256(program.encode() + file.read_bytes()).hexdigest()


if __name__ == "__main__":
    PROGRAM = program_digest()
    for problem in problems():
        if problem.suffix == ".toml" and problem.stem not in LIVE:
            # What is wrong with a problem is for the build to say.
            with contextlib.suppress(SceneError, SolveError):
                made(problem, PROGRAM)
