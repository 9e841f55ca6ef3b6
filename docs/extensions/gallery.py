"""The gallery: one page for each problem file, with its picture, what was found and what is known."""

from __future__ import annotations

import re
import shutil
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from entries import GALLERY, LIVE, TURNING, Entry, made, problems, program_digest
from pages import write_pages
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.display import status_iterator

from sfetcas.errors import SceneError, SolveError

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
    # In no table of contents: nearly two hundred titles beside each page would take much of the time of a build.
    parts = [
        f"---\norphan: true\n---\n\n# {plain_text(entry.title)}\n",
        f"[{entry.group}]({_file_of(entry.group)}.md)\n",
    ]
    if entry.text:
        parts.append(_fenced(entry.text, "{eval-rst}"))
    parts.append(_turning(file.stem))
    if entry.picture:
        parts.append(f"![{plain_text(entry.title)}](pictures/{file.stem}.png)\n")
    if entry.source:
        parts.append(f"Source: {plain_text(entry.source)}\n")
    took = f"It took {entry.seconds:.2g} s when this page was made.\n"
    language = "python" if file.suffix == ".py" else "toml"
    parts += [
        "## Run it\n",
        _fenced(entry.command, "console"),
        took,
        "## Found beside expected\n",
        _comparisons(entry),
        "## The file\n",
        f"```{{literalinclude}} ../../problems/{file.name}\n:language: {language}\n```\n",
    ]
    if entry.found:
        parts += ["## The report\n", _fenced(entry.found)]
    return "\n".join(parts)


def _turning(name: str) -> str:
    """The page that turns in a frame of its own, which is loaded when it comes into view."""
    look = "width: 100%; height: 480px; border: 1px solid #ccc"
    how = f'title="{name}" loading="lazy" sandbox="allow-scripts" style="{look}"'
    frame = f'<iframe src="turning/{name}.html" {how}></iframe>'
    live = "Drag a slider, or the tip of an arrow: this page solves the scene itself. " if name in LIVE else ""
    alone = f'<p>{live}<a href="turning/{name}.html">The same on its own.</a></p>'
    return f"```{{raw}} html\n{frame}\n{alone}\n```\n"


def _comparisons(entry: Entry) -> str:
    """A table of what was compared, with the reasons of the tolerances as notes below it."""
    notes = list(dict.fromkeys(c.reason for c in entry.comparisons if c.reason))
    if entry.group == "Programs":
        rows = ["| difference of | found | accepted |", "|---|---|---|"]
        cells = [[c.quantity, f"{c.difference:.1e}", c.tolerance] for c in entry.comparisons]
    else:
        rows = ["| quantity | expected | found | difference | accepted | note |", "|---|---|---|---|---|---|"]
        cells = [
            [
                *(c.quantity, c.expected, c.found, f"{c.difference:.1e}", c.tolerance),
                str(notes.index(c.reason) + 1) if c.reason else "",
            ]
            for c in entry.comparisons
        ]
    rows += [f"| {' | '.join(map(plain_text, row))} |" for row in cells]
    return "\n".join([*rows, "", *(f"{i}. {plain_text(note)}" for i, note in enumerate(notes, start=1)), ""])


def _pages_of_groups(entries: list[Entry]) -> dict[str, str]:
    """The page of each group, with all its pictures, and the index of groups, by file name."""
    pages, rows = {}, []
    for group in GROUPS:
        chosen = [entry for entry in entries if entry.group == group]
        page = _file_of(group)
        table = [f"# {group}\n", "| | | |", "|---|---|---|"]
        for first in range(0, len(chosen), WIDE):
            cells = [_cell(entry) for entry in chosen[first : first + WIDE]]
            table.append(f"| {' | '.join(cells + [''] * (WIDE - len(cells)))} |")
        pages[page] = "\n".join([*table, ""])
        drawn = [entry for entry in chosen if entry.picture]
        shown = " | ".join(_picture(entry, 200) for entry in drawn[:: max(1, len(drawn) // WIDE)][:WIDE])
        rows.append(f"| [{group}]({page}.md), {len(chosen)} | {shown} |")
    live = [f"[{plain_text(entry.title)}]({entry.name}.md)" for entry in entries if entry.name in LIVE]
    text = (
        "# Gallery\n\nEach file of `problems/` has a page: its picture, the file, what is expected and from where, and "
        "what is found. The pages are made with the documentation; the build fails if a value is missed.\n\n"
        "In each page the answer is turned, played and picked from in a frame."
    )
    text += f" Some frames have the solver itself, which solves while you drag: {', '.join(live)}.\n" if live else "\n"
    listed = "\n".join(pages)
    table = "\n".join(["|" + " |" * (1 + WIDE), "|" + "---|" * (1 + WIDE), *rows])
    return {**pages, "index": f"{text}\n{table}\n\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n"}


def _file_of(group: str) -> str:
    return group.lower().replace(" ", "-")


def _cell(entry: Entry) -> str:
    return f"{_picture(entry, 220)} [{plain_text(entry.title)}]({entry.name}.md)"


def _picture(entry: Entry, width: int) -> str:
    drawn = f'![{plain_text(entry.title)}](pictures/{entry.name}.png){{width="{width}px"}}'
    return f"[{drawn}]({entry.name}.md)" if entry.picture else ""


def _generate(app: Sphinx) -> None:
    files, digest = problems(), program_digest()
    with ProcessPoolExecutor() as pool:
        # Programs take longest: they come first, so that none is waited for at the end.
        made_first = {file: pool.submit(_tried, file, digest) for file in sorted(files, key=lambda one: one.suffix)}
        runs = [made_first[file] for file in files]
        shown = status_iterator(runs, "gallery... ", "brown", len(runs), app.verbosity)
        found = [run.result() for run in shown]
    wrong = [entry for entry in found if isinstance(entry, str)]
    if wrong:
        raise ExtensionError("problems: " + "; ".join(wrong))
    entries = [entry for entry in found if isinstance(entry, Entry)]
    pages = {entry.name: _page(entry, file) for entry, file in zip(entries, files, strict=True)}
    pages |= _pages_of_groups(entries)
    write_pages(GALLERY, pages)
    for page in (*GALLERY.glob("*.md"), *TURNING.glob("*.html")):
        if page.stem not in pages:
            page.unlink()


def _copy_turning(app: Sphinx, error: Exception | None) -> None:
    """Put the pages that turn beside those that show them."""
    if error is None and app.builder.format == "html":
        shutil.copytree(TURNING, Path(app.outdir) / "gallery" / TURNING.name, dirs_exist_ok=True)


_TREES: dict[tuple[Any, ...], str] = {}
"""Tables of contents beside pages that stand in none, by folder and what the theme asks for."""


def _share_tree(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Beside pages that stand in no table of contents it is the same in each folder, and made once."""
    make = context["toctree"]

    def tree(**asked: Any) -> str:
        key = (page.rpartition("/")[0], *sorted(asked.items()))
        if key not in _TREES:
            _TREES[key] = make(**asked)
        return _TREES[key]

    if "orphan" in (context.get("meta") or {}):
        context["toctree"] = tree


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the pages before Sphinx looks which there are."""
    app.connect("builder-inited", _generate)
    app.connect("build-finished", _copy_turning)
    # Before the theme does.
    app.connect("html-page-context", _share_tree, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
