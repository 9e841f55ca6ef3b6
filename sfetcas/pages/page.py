"""Pages for a browser: an answer, the viewer that draws it and its looks in one file, which asks for nothing else.

What comes from a scene is text in the page and never markup: all of it stands in one table of JSON without ``<``, and
the viewer puts it where it is seen as text.
"""

from __future__ import annotations

import html
import json
import os
import re
from pathlib import Path as File

import numpy as np

from ..equilibria.settings import Settings
from ..errors import SceneError
from ..files import write_file
from ..parametric.arguments import Asked
from ..pictures.files import check_ending
from .content import MOST_STATES, Shown, content_of
from .live import check_live, live_of

__all__ = ["ENDINGS", "View", "page_of", "save_page"]

PARTS = File(__file__).parent
HEIGHT = 560
"""Of a page in a notebook, pixels."""

LIVE_PART = "  /* On live pages the text of live.js stands here. */\n"


ENDINGS = (".html", ".htm")
"""Endings of the files that pages are written to."""


def page_of(
    answer: Shown,
    source: str | None = None,
    said: str | None = None,
    *,
    live: bool = False,
    arguments: Asked = None,
    settings: Settings | None = None,
    most: int = MOST_STATES,
) -> str:
    """The text of a page that shows an answer.

    Parameters
    ----------
    answer : Solution, Path, Trajectory or Modes
    source : str, optional
        The text of the scene file; by default the scene as JSON.
    said : str, optional
        A report of the answer; by default what Python shows of it.
    live : bool
        Whether the page has the solver itself, as WebAssembly.
    arguments
        Numbers of the scene that change on a live page, as of :func:`sfetcas.export`; by default the factor, all loads
        and all motions.
    settings : Settings, optional
        Accuracy and elements of the solver of a live page.
    most : int
        States of a path or a motion at most, a third of them on a live page.

    Raises
    ------
    SceneError
        The scene has no member that could be seen, or no live page shows it, see
        :func:`~sfetcas.pages.live.check_live`.
    """
    if live:
        check_live(answer.scene)
    elif arguments is not None:
        raise SceneError("found arguments of a page that is not live, accepted: with live", ("arguments",))
    if source is None:
        source = json.dumps(answer.scene.to_dict(), indent=2, ensure_ascii=False)
    said = repr(answer) if said is None else said
    # The solver takes most of the room, and makes states of its own.
    found = content_of(answer, source, said, most=most)
    if live:
        places = {member["name"]: np.array(member["x"]) for member in found["members"]}
        found["live"] = live_of(answer.scene, places, arguments, settings)
    content = json.dumps(found, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    parts = {
        "title": html.escape(answer.scene.title or "sfetcas"),
        "style": (PARTS / "viewer.css").read_text(encoding="utf-8"),
        "viewer": _viewer(live=live),
        # The solver of a live page is compiled code.
        "wasm": " 'wasm-unsafe-eval'" if live else "",
        # Within a script nothing ends it but "</script", and "<!--" would change how it is read.
        "content": content.replace("<", "\\u003c"),
    }
    template = (PARTS / "page.html").read_text(encoding="utf-8")
    return re.sub(r"@(title|style|viewer|wasm|content)@", lambda found: parts[found[1]], template)


def _viewer(*, live: bool) -> str:
    """The script of a page; that of a live one has the part that runs the solver."""
    text = (PARTS / "viewer.js").read_text(encoding="utf-8")
    part = (PARTS / "live.js").read_text(encoding="utf-8") if live else ""
    return text.replace(LIVE_PART, part)


def save_page(answer: Shown, file: str | os.PathLike[str], *, live: bool = False, arguments: Asked = None) -> None:
    """Write :func:`page_of` to a file, all of it or nothing.

    Raises
    ------
    SceneError
        As :func:`page_of`; the file has another ending, or cannot be written.
    """
    check_ending(file, ENDINGS, "a page")
    text = page_of(answer, live=live, arguments=arguments)
    write_file(File(file), lambda path: path.write_text(text, encoding="utf-8"))


class View:
    """A page that notebooks show.

    Parameters
    ----------
    answer : Solution, Path, Trajectory or Modes
    live, arguments
        As of :func:`page_of`.
    """

    def __init__(self, answer: Shown, *, live: bool = False, arguments: Asked = None) -> None:
        self.page = page_of(answer, live=live, arguments=arguments)

    def _repr_html_(self) -> str:
        """The page in a frame of its own, which knows nothing of the notebook."""
        look = f"width: 100%; height: {HEIGHT}px; border: 1px solid #ccc"
        return f'<iframe sandbox="allow-scripts" style="{look}" srcdoc="{html.escape(self.page)}"></iframe>'
