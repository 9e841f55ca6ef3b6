"""What has to be loaded first: seconds of imports and of a first answer; part of ``python -m benchmarks``."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

__all__ = ["importing"]

RUNS = 15
"""Of each; they take turns, so that whatever else the machine does meanwhile slows all alike."""

FILE = "problems/cantilever_tip_force.toml"
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
    seconds: dict[str, list[float]] = {name: [] for name in COMMANDS}
    for _ in range(RUNS):
        for name, words in COMMANDS.items():
            begin = time.perf_counter()
            subprocess.run([sys.executable, *words], check=True, capture_output=True)
            seconds[name].append(time.perf_counter() - begin)
    medians = {name: statistics.median(found) for name, found in seconds.items()}
    for name, median in medians.items():
        print(f"{name:>28} {median:8.3f} s {median / medians['import casadi']:6.1f}")
