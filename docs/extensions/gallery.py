"""The gallery: one page for each problem file, made from it, with its picture and what was found.

A problem is solved, checked and drawn again only after it or the program has changed; what was made of it is kept in
``docs/gallery``.  The test of the problems makes the same entries, so that a build after the tests finds them.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import io
import json
import os
import re
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.display import status_iterator

from sfetcas import Scene, load, solve
from sfetcas.checks import check
from sfetcas.description.records import say
from sfetcas.errors import SceneError, SolveError
from sfetcas.outputs import _plot
from sfetcas.reports import report

ROOT = Path(__file__).resolve().parents[2]
PROBLEMS = ROOT / "problems"
GALLERY = ROOT / "docs" / "gallery"
PICTURES = GALLERY / "pictures"
KEPT = GALLERY / "kept"

GROUPS = (
    "Statics in the plane",
    "Statics in space",
    "Contact",
    "Paths and stability",
    "Vibrations",
    "Motion",
    "Programs",
)
WIDE = 3
"""Pictures in a row of the index."""


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
    PICTURES.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"figure.dpi": 100, "savefig.dpi": 100}):
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
            expected=say(entry.expect.value),
            found=_rounded(entry.value),
            difference=entry.error,
            tolerance="exactly" if entry.expect.tolerance is None else f"{entry.expect.tolerance:.1e}",
            reason="; ".join(filter(None, (entry.expect.why, entry.expect.source))),
            passed=entry.passed,
        )
        for entry in check(scene, answer)
    ]
    drawing = PICTURES / f"{file.stem}.png"
    _plot(drawing, scene)(answer, drawing)
    title = scene.title or file.stem
    command = f"sfetcas run problems/{file.name} --plot {file.stem}.png"
    return Entry(
        file.stem, title, _group(scene), scene.source, "", command, said.getvalue(), comparisons, seconds, picture=True
    )


def _choice(expect: Any) -> Iterator[str]:
    for key in ("at", "step", "time", "equilibrium", "crossing", "limit_point", "bifurcation", "flutter_point"):
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
        raise ExtensionError(f"{file} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    begun = time.perf_counter()
    differences = module.check()
    seconds = time.perf_counter() - begun
    comparisons = [
        Comparison(name, "", "", float(value), f"{module.TOLERANCE:.1e}", "", bool(value <= module.TOLERANCE))
        for name, value in differences.items()
    ]
    drawn = hasattr(module, "picture")
    if drawn:
        module.picture().savefig(PICTURES / f"{file.stem}.png")
    title, _, text = (module.__doc__ or file.stem).partition("\n")
    command = f"python problems/{file.name}"
    return Entry(
        file.stem, title.rstrip("."), "Programs", "", text.strip(), command, "", comparisons, seconds, picture=drawn
    )


# -- what was made before -------------------------------------------------------------------------------


def program_digest() -> str:
    """A digest of the program and of this module."""
    digest = hashlib.sha256()
    for file in sorted([*(ROOT / "sfetcas").rglob("*.py"), Path(__file__)]):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def made(file: Path, digest: str) -> Entry:
    """The entry of a problem, made anew where the problem or the program (its digest) is another than before."""
    kept, digest = KEPT / f"{file.name}.json", hashlib.sha256(digest.encode() + file.read_bytes()).hexdigest()
    if kept.exists():
        found = json.loads(kept.read_text(encoding="utf-8"))
        entry = Entry(**{**found["entry"], "comparisons": [Comparison(**c) for c in found["entry"]["comparisons"]]})
        if found["digest"] == digest and (not entry.picture or (PICTURES / f"{file.stem}.png").exists()):
            return entry
    entry = entry_of(file)
    KEPT.mkdir(parents=True, exist_ok=True)
    part = kept.with_suffix(f".{os.getpid()}")
    part.write_text(json.dumps({"digest": digest, "entry": asdict(entry)}), encoding="utf-8")
    part.replace(kept)
    return entry


def _tried(file: Path, digest: str) -> Entry | str:
    """The entry, or what is wrong with it: failures of other processes are told, not raised."""
    try:
        entry = made(file, digest)
    except (SceneError, SolveError) as error:
        return f"{file.name} is not solved: {error}"
    missed = [comparison.quantity for comparison in entry.comparisons if not comparison.passed]
    return f"{file.name} is solved, but misses {', '.join(missed)}" if missed else entry


# -- pages ---------------------------------------------------------------------------------------------


def plain_text(text: str) -> str:
    """A text that stands for itself in Markdown, on one line."""
    return re.sub(r"([\\`*_{}\[\]()<>#+\-.!|$~^&:'\"@%=])", r"\\\1", " ".join(text.split()))


def _fenced(text: str, language: str = "text") -> str:
    fence = "`" * max(3, 1 + max(map(len, re.findall(r"`+", text)), default=0))
    return f"{fence}{language}\n{text.rstrip()}\n{fence}\n"


def _page(entry: Entry, file: Path) -> str:
    parts = [f"# {plain_text(entry.title)}\n"]
    if entry.source:
        parts.append(f"Source: {plain_text(entry.source)}\n")
    if entry.text:
        parts.append(_fenced(entry.text, "{eval-rst}"))
    if entry.picture:
        parts.append(f"![{plain_text(entry.title)}](pictures/{file.stem}.png)\n")
    parts += ["## Run it\n", _fenced(entry.command, "console")]
    if entry.found:
        parts += ["## What is found\n", _fenced(entry.found)]
    parts += ["## Compared\n", _comparisons(entry)]
    language = "python" if file.suffix == ".py" else "toml"
    parts += ["## The file\n", f"```{{literalinclude}} ../../problems/{file.name}\n:language: {language}\n```\n"]
    return "\n".join(parts)


def _comparisons(entry: Entry) -> str:
    if file_is_program := entry.group == "Programs":
        rows = ["| difference of | found | accepted |", "|---|---|---|"]
    else:
        rows = ["| quantity | expected | found | difference | accepted | reason, source |", "|---|---|---|---|---|---|"]
    for c in entry.comparisons:
        cells = [plain_text(c.quantity)]
        cells += [] if file_is_program else [plain_text(c.expected), plain_text(c.found)]
        cells += [f"{c.difference:.1e}", plain_text(c.tolerance)]
        cells += [] if file_is_program else [plain_text(c.reason)]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + f"\n\nThis took {entry.seconds:.2f} s when the page was made.\n"


def _index(entries: list[Entry]) -> str:
    parts = [
        "# Gallery\n",
        "Each file of `problems/` has a page: its picture, the file, what is expected and from where, and what is found.",
        "They are made anew with each build, and the build fails where a value is missed.\n",
    ]
    for group in GROUPS:
        chosen = [entry for entry in entries if entry.group == group]
        parts += [f"## {group}\n", "| | | |", "|---|---|---|"]
        for first in range(0, len(chosen), WIDE):
            cells = [_cell(entry) for entry in chosen[first : first + WIDE]]
            parts.append(f"| {' | '.join(cells + [''] * (WIDE - len(cells)))} |")
        parts.append("")
    names = "\n".join(entry.name for entry in entries)
    return "\n".join(parts) + f"\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"


def _cell(entry: Entry) -> str:
    image = f"[![]( pictures/{entry.name}.png)]({entry.name}.md) " if entry.picture else ""
    return f"{image.replace('( ', '(')}[{plain_text(entry.title)}]({entry.name}.md)"


def _generate(app: Sphinx) -> None:
    files, digest = problems(), program_digest()
    with ProcessPoolExecutor() as pool:
        runs = [pool.submit(_tried, file, digest) for file in files]
        shown = status_iterator(runs, "gallery... ", "brown", len(runs), app.verbosity)
        found = [run.result() for run in shown]
    wrong = [entry for entry in found if isinstance(entry, str)]
    if wrong:
        raise ExtensionError("problems: " + "; ".join(wrong))
    entries = [entry for entry in found if isinstance(entry, Entry)]
    for entry, file in zip(entries, files, strict=True):
        _write(GALLERY / f"{entry.name}.md", _page(entry, file))
    _write(GALLERY / "index.md", _index(entries))
    for page in GALLERY.glob("*.md"):
        if page.stem not in {"index", *(entry.name for entry in entries)}:
            page.unlink()


def _write(file: Path, text: str) -> None:
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the pages before Sphinx looks which there are."""
    app.connect("builder-inited", _generate)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
