"""The gallery: a page for each problem, names as text, and no documentation of a problem that is not solved."""

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import entries
import pytest

pytest.importorskip("sphinx")
pytest.importorskip("myst_parser")
import gallery
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

HOSTILE = "a \"b\" 'c' </script><script>alert(1)</script> & `d` *e* _f_ [g](h) {i} $j$ % | \\ # <!-- k --> ü 梁 {{l}}"

SCENE = """
title = {title}
source = {title}
[sections.strip]
EI3 = 1.0
[nodes.root]
position = [0, 0]
support = "clamped"
[nodes.tip]
position = [1, 0]
{more}
[members.beam]
nodes = ["root", "tip"]
section = "strip"
[loads.tip]
type = "force"
node = "tip"
value = [0, 1]
[[expect]]
quantity = "nodes.tip.position.y"
value = {value}
tolerance = 1e-3
why = {title}
"""
TIP = 0.301721
"""Elliptic integrals."""


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """A place for entries that is not that of the documentation."""
    for name in ("GALLERY", "PICTURES", "KEPT"):
        monkeypatch.setattr(entries, name, tmp_path / "gallery" / getattr(entries, name).name)
    monkeypatch.setattr(gallery, "GALLERY", entries.GALLERY)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    return tmp_path


def written(folder, *, title="'bent'", value=TIP, more=""):
    file = folder / "bent.toml"
    file.write_text(SCENE.format(title=title, value=value, more=more), encoding="utf-8")
    return file


def test_entry_has_what_is_found_beside_what_is_expected(folder):
    entry = entries.made(written(folder), "program")
    (comparison,) = entry.comparisons
    assert (entry.title, entry.group, comparison.passed) == ("bent", "Statics in the plane", True)
    # nine digits are shown
    assert comparison.difference == pytest.approx(abs(float(comparison.found) - TIP), abs=1e-9)
    assert (entries.PICTURES / "bent.png").stat().st_size > 10_000
    assert "node tip: position" in entry.found


def test_entry_is_made_anew_where_file_or_program_changes(folder, monkeypatch):
    file = written(folder)
    made = entries.made(file, "program")
    assert entries.kept(file, "program") == made
    assert entries.kept(file, "another program") is None
    written(folder, title="'bent otherwise'")
    assert entries.kept(file, "program") is None
    assert entries.made(file, "program").title == "bent otherwise"
    (entries.PICTURES / "bent.png").unlink()
    assert entries.kept(file, "program") is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"value": 0.5}, "bent.toml is solved, but misses nodes.tip.position.y"),
        ({"more": "support = 'bolted'"}, r"bent.toml is not solved: .*nodes.tip.support: found 'bolted'"),
    ],
)
def test_documentation_of_a_problem_that_is_not_solved_fails_and_names_it(folder, monkeypatch, change, said):
    file = written(folder, **change)
    monkeypatch.setattr(gallery, "problems", lambda: [file])
    monkeypatch.setattr(gallery, "ProcessPoolExecutor", ThreadPoolExecutor)
    with pytest.raises(ExtensionError, match=said):
        gallery._generate(SimpleNamespace(verbosity=0))
    assert not list(entries.GALLERY.glob("*.md"))


# The parser of pages resolves links by a name that Sphinx is about to drop; no matter of these pages.
@pytest.mark.filterwarnings("ignore:'myst_parser.*is deprecated")
def test_names_are_text_on_pages(folder):
    """What a browser is given has no markup of theirs."""
    quoted = '"' + HOSTILE.replace("\\", "\\\\").replace('"', '\\"') + '"'
    entry = entries.made(written(folder, title=quoted), "program")
    assert entry.title == HOSTILE
    source = folder / "source"
    (source / "a" / "b").mkdir(parents=True)
    (source / "problems").mkdir()
    (source / "problems" / "bent.toml").write_text(written(folder, title=quoted).read_text("utf-8"), encoding="utf-8")
    page = gallery._page(entry, Path("bent.toml"))
    (source / "a" / "b" / "bent.md").write_text(page, encoding="utf-8")
    (source / "a" / "b" / "pictures").mkdir()
    (source / "a" / "b" / "pictures" / "bent.png").write_bytes((entries.PICTURES / "bent.png").read_bytes())
    (source / "a" / "b" / f"{gallery._file_of(entry.group)}.md").write_text("# Group\n", encoding="utf-8")
    (source / "index.md").write_text(
        f"# Index\n\n```{{toctree}}\na/b/{gallery._file_of(entry.group)}\n```\n", encoding="utf-8"
    )
    settings = {
        "extensions": ["myst_parser"],
        "smartquotes": False,
        "myst_enable_extensions": ["attrs_inline", "colon_fence", "deflist", "dollarmath"],
    }
    places = (source, None, folder / "out", folder / "trees")
    Sphinx(*places, "html", settings, status=None, warningiserror=True).build()
    built = (folder / "out" / "a" / "b" / "bent.html").read_text(encoding="utf-8")
    assert "<script>alert" not in built
    assert "<!-- k -->" not in built
    text = re.sub(r"\s+", " ", re.search(r"<h1>(.*?)<a", built, re.DOTALL)[1])
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; `d` *e* _f_ [g](h) {i} $j$ % | \\ # &lt;!-- k" in text
