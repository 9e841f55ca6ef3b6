"""Texts of a scene - its title, names of nodes, loads, ... - as parts of other languages, where they are data only.

Whatever makes a file or a line for somebody else takes such a text through the function of its language; Makefiles,
CMake files and names of files have none of them.  JSON, XML (of units of FMI) and SVG are written by libraries, which
escape by themselves, and files for ParaView have no names.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from typing import Any

__all__ = [
    "c_comment",
    "c_string",
    "csv_cell",
    "identifiers",
    "in_docstring",
    "markdown",
    "markdown_cell",
    "printable",
    "python_string",
    "shell_word",
]


def printable(text: str) -> str:
    """For one line of a terminal: characters that are not printable, as control codes, as Python's escapes.

    >>> printable("a\\x1b[2J\\n")
    'a\\\\x1b[2J\\\\n'
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def identifiers(names: Iterable[str]) -> list[str]:
    """For the ends of identifiers of C: capitals, other characters as _, equal ones numbered.

    >>> identifiers(["tip load", "tip-load", "*/"])
    ['TIP_LOAD', 'TIP_LOAD_2', '__']
    """
    found: dict[str, None] = {}
    for name in names:
        plain = re.sub(r"\W", "_", name, flags=re.ASCII).upper()
        count, unique = 2, plain
        while unique in found:
            unique, count = f"{plain}_{count}", count + 1
        found[unique] = None
    return list(found)


def c_string(text: str) -> str:
    """For C, as a string literal with its quotes: UTF-8, bytes that are not plain characters as octal escapes.

    Three octal digits end an escape, whatever follows; question marks are escaped since they may begin a trigraph.

    >>> c_string('é"?1')
    '"\\\\303\\\\251\\\\042\\\\0771"'
    """
    plain = (chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in text.encode())
    return f'"{"".join(plain)}"'


def c_comment(text: str) -> str:
    """For a comment of C, on one line: the text neither ends the comment nor begins another, and has no trigraphs.

    >>> c_comment("a */ b ??/")
    'a * / b ? ?/'
    """
    shown = printable(" ".join(text.split()))
    return re.sub(r"\*(?=/)|/(?=\*)|\?(?=\?)", lambda match: f"{match[0]} ", shown)


def python_string(text: str) -> str:
    """For Python, as a string literal with its quotes, in ASCII."""
    return ascii(text)


def in_docstring(text: str) -> str:
    """For the inside of a Python string in three double quotes, the value of which is the text again.

    >>> in_docstring(3 * chr(34)) == 3 * (chr(92) + chr(34))
    True
    """
    return text.encode("unicode_escape").decode("ascii").replace('"', '\\"')


def shell_word(text: str) -> str:
    """For a POSIX shell, as one word of an example; empty for an empty text."""
    return shlex.quote(text) if text else ""


def markdown(text: str) -> str:
    """For a line of Markdown that shows just these characters: no link, picture, table, formula or HTML.

    >>> markdown("<b> | $x$ tip_load")
    '\\\\<b\\\\> \\\\| \\\\$x\\\\$ tip\\\\_load'
    """
    return re.sub(r"([\\`*_\[\]<>|&~$#!])", r"\\\1", printable(" ".join(text.split())))


def markdown_cell(text: str) -> str:
    """For a cell of a Markdown table: as code, or as escaped text if it has characters that would end the code."""
    return markdown(text) if re.search(r"[`|\\]", text) or text != text.strip() else f"`{printable(text)}`"


def csv_cell(value: Any) -> Any:
    """For a cell of a CSV table: a text that a spreadsheet would take for a formula gets an apostrophe; None is empty.

    >>> [csv_cell(value) for value in ("=1+1", "loads.tip", -1.5, None)]
    ["'=1+1", 'loads.tip', -1.5, '']
    """
    if isinstance(value, str) and value.lstrip()[:1] in tuple("=+-@"):
        return f"'{value}"
    return "" if value is None else value
