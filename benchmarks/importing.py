"""What has to be loaded first: seconds of imports and of a first answer; part of ``python -m benchmarks``."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time

from .saving import head, row

__all__ = ["importing"]

RUNS = 15
"""Of each; they take turns, so that whatever else the machine does meanwhile slows all alike."""

FILE = "problems/hinged_beam_end_shortening.toml"
"""A small scene."""

COMMANDS = {
    "import casadi": ["-c", "import casadi"],
    "import sfetcas": ["-c", "import sfetcas"],
    "from sfetcas import solve": ["-c", "from sfetcas import solve"],
    "sfetcas --help": ["-m", "sfetcas", "--help"],
    "sfetcas run": ["-m", "sfetcas", "run", FILE],
}
"""What is run, each in a process of its own."""


def importing() -> None:
    """Medians over fresh processes, and as multiples of what CasADi itself needs."""
    print(f"Imports and a first answer ({FILE}), medians of {RUNS} processes; multiples of import casadi\n")
    head("command", "s", "multiple")
    with tempfile.TemporaryDirectory() as folder:
        # As installed: with the bytecode of all kept, which some environments forbid.
        kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        rounds = [_round({**kept, "PYTHONPYCACHEPREFIX": folder}) for _ in range(RUNS + 1)]
    # The first one made the bytecode.
    medians = {name: statistics.median(times[name] for times in rounds[1:]) for name in COMMANDS}
    for name, median in medians.items():
        row(f"`{name}`", f"{median:.3f}", f"{median / medians['import casadi']:.1f}")


def _round(environment: dict[str, str]) -> dict[str, float]:
    """Seconds of each command, once."""
    seconds = {}
    for name, words in COMMANDS.items():
        begin = time.perf_counter()
        subprocess.run([sys.executable, *words], check=True, capture_output=True, env=environment)
        seconds[name] = time.perf_counter() - begin
    return seconds
