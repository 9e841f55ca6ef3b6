"""What README and documentation show runs as it stands, and what they say of the program is what the program says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import tomli

from sfetcas import Scene, load

markdown = pytest.importorskip("markdown_it")

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
MADE = ("gallery", "reference/generated", "reference/api", "reference/modules", "extensions")
"""Folders of the documentation that are made from the program."""

PAGES = [
    ROOT / "README.md",
    *sorted(page for page in DOCS.rglob("*.md") if not page.relative_to(DOCS).as_posix().startswith(MADE)),
]


class Block:
    """A block of code of a page: its language or directive, its options, its text and its line."""

    def __init__(self, token):
        self.directive, _, argument = token.info.strip().partition(" ")
        self.language = argument if self.directive == "{code-block}" else self.directive
        self.line = token.map[0] + 1
        head = re.match(r"(?::[\w-]+:.*\n)*", token.content)[0] if self.directive.startswith("{") else ""
        self.options = dict(re.findall(r"^:([\w-]+): *(.*)$", head, re.MULTILINE))
        self.text = token.content[len(head) :]


def blocks(page):
    tokens = markdown.MarkdownIt().parse(page.read_text(encoding="utf-8"))
    return [Block(token) for token in tokens if token.type == "fence" and token.info.strip()]


def is_run(block):
    return block.language in ("python", "{plot}", "sh") or "caption" in block.options


def is_scene(block):
    """Whether it is a whole scene; other TOML is read, too."""
    table = tomli.loads(block.text) if block.language == "toml" else {}
    return {"nodes", "members"} <= set(table) and any("position" in node for node in table["nodes"].values())


RUN = [page for page in PAGES if any(map(is_run, blocks(page)))]


def printed(text):
    """Lines whose comment prints numbers with dots behind them, and their digits."""
    for line in text.splitlines():
        if found := re.match(r"(\S.*?)  # (.*)$", line):
            digits = re.findall(r"(-?\d+\.\d+(?:e-?\d+)?)\.\.\.", found[2])
            if digits:
                yield found[1], digits


def run_python(block, names, page):
    """Run a block; what a comment prints with dots is what its line gives, digit by digit."""
    lead = "\n" * block.line
    exec(compile(lead + block.text, str(page), "exec"), names)
    for line, digits in printed(block.text):
        # What a line gives may be the value that it names.
        expression = line.partition(" = ")[2] if re.match(r"[\w, ]+ = ", line) else line
        found = iter(np.ravel(np.asarray(eval(expression, names), dtype=float)))
        for told in digits:
            # In this order; others between them may be printed without dots.
            assert any(f"{value:.12f}".startswith(told) for value in found), f"{page.name}, line {block.line}: {line}"


def run_shell(block, folder):
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block.text],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"line {block.line}: {done.stdout}{done.stderr}"


@pytest.mark.parametrize("page", RUN, ids=lambda page: str(page.relative_to(ROOT)))
def test_page_runs_as_it_stands(page, monkeypatch, tmp_path):
    """From top to bottom beside the problems; what it writes is not left there."""
    (tmp_path / "problems").symlink_to(ROOT / "problems")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)
    names = {"__name__": "__main__"}
    for block in blocks(page):
        if "caption" in block.options:
            (tmp_path / block.options["caption"]).write_text(block.text, encoding="utf-8")
            if is_scene(block):
                # Beside the files that blocks before it wrote.
                load(tmp_path / block.options["caption"])
        elif block.language in ("python", "{plot}"):
            run_python(block, names, page)
        elif block.language == "sh" and page.name != "README.md":
            # The two of the README are what continuous integration runs.
            run_shell(block, tmp_path)
    plt.close("all")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_scenes_of_a_page_are_scenes(page):
    for block in blocks(page):
        if is_scene(block) and "caption" not in block.options:
            Scene.from_dict(tomli.loads(block.text))


def test_links_of_the_readme_lead_somewhere():
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md"):
        links = re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
        assert links
        for link in links:
            file, _, anchor = link.partition("#")
            if "://" in link:
                continue
            assert (ROOT / file).exists(), link
            if anchor:
                headings = re.findall(r"^#+ (.*)$", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
                assert anchor in {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


def test_readme_is_short():
    """What it says is said in two minutes; all else has its page."""
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 200


def test_a_wrong_digit_is_noticed(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python\nvalue = 0.25\nvalue  # 0.26...\n```\n", encoding="utf-8")
    with pytest.raises(AssertionError, match=r"page.md, line 1"):
        run_python(blocks(page)[0], {}, page)


def test_every_module_stands_in_the_table():
    rows = [
        line
        for line in (DOCS / "developer" / "architecture.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| `")
    ]
    folder = ROOT / "sfetcas"
    for place in (folder, folder.with_name("benchmarks"), *(path.parent for path in folder.glob("*/__init__.py"))):
        modules = {file.stem for file in place.glob("*.py")} - {"__init__", "__main__"}
        listed = {
            word
            for line in rows
            if (place == folder) == (not line.startswith("| `" + place.name + "/`"))
            for word in re.findall(r"`(\w+)`", line.split("|")[1 if place == folder else 2])
        }
        assert modules <= listed, place.name
