"""The core compiled to a library, at installation and where one is missing; this file imports nothing of the package.

A library is named by its sources and by what it holds, so that one of other sources, or one that was cut short or
changed, is never loaded.  Installing never fails for want of a compiler: everything works without, only slower.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

__all__ = ["FLAGS", "SOURCES", "SUFFIX", "compile_core", "compiler", "named", "prefix", "whole"]

SOURCES = Path(__file__).parent
"""Folder of the sources; ``core.c`` includes all others."""

FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fPIC", "-shared")
"""No operations are fused, whatever the processor has: answers have the same bits everywhere."""


SUFFIX = ".library"
"""End of the name of a library: it is no module that Python could import."""

LARGEST = 10_000_000
"""Bytes of a library that is looked at; the core has less than a hundred thousand."""


def compiler() -> str | None:
    """The C compiler: $CC, else cc or gcc; None where there is none."""
    return shutil.which(os.environ.get("CC") or "cc") or shutil.which("gcc")


def prefix() -> str:
    """Beginning of the name of a library of these sources on this kind of machine."""
    content = hashlib.sha256("\n".join([sys.platform, platform.machine(), *FLAGS]).encode())
    for source in sorted([*SOURCES.glob("*.c"), *SOURCES.glob("*.h")]):
        content.update(source.read_bytes())
    return f"core-{content.hexdigest()[:24]}-"


def named(beginning: str, library: bytes, suffix: str = SUFFIX) -> str:
    """Name of a library with its checksum."""
    return f"{beginning}{hashlib.sha256(library).hexdigest()[:32]}{suffix}"


def whole(folder: Path, beginning: str) -> Path | None:
    """A library in a folder whose name begins so and which holds what its name says; None where there is none."""
    for path in sorted(folder.glob(f"{beginning}*{SUFFIX}")):
        if path.is_file() and path.stat().st_size <= LARGEST and named(beginning, path.read_bytes()) == path.name:
            return path
    return None


def compile_core(folder: Path) -> Path | None:
    """Put a library of the core into a folder; None where there is no compiler, or it fails."""
    command = compiler()
    if command is None:
        return None
    try:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            made = Path(place) / "made"
            call = [command, *FLAGS, "-o", str(made), str(SOURCES / "core.c"), "-lm"]
            subprocess.run(call, check=True, capture_output=True, env={**os.environ, "TMPDIR": place})
            found = folder / named(prefix(), made.read_bytes())
            os.replace(made, found)
    except (OSError, subprocess.CalledProcessError):
        return None
    return found
