"""Description of the machine that a measurement was made on."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import casadi as ca
import numpy as np

__all__ = ["machine"]


def machine() -> dict[str, str]:
    """Processor, cores, load, memory, system and versions, as texts; what the system does not tell is left out."""
    found = {
        "processor": _processor(),
        "cores": str(os.cpu_count() or ""),
        "load": f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "",
        "memory": _memory(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "casadi": ca.CasadiMeta.version(),
        "numpy": np.__version__,
        "sfetcas": _version(),
        "compiler": _compiler(),
    }
    return {key: value for key, value in found.items() if value}


def _version() -> str:
    try:
        return version("sfetcas")
    except PackageNotFoundError:
        # Run from its folder without being installed.
        return ""


def _processor() -> str:
    listed = Path("/proc/cpuinfo")
    if listed.exists():
        for line in listed.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _memory() -> str:
    if not hasattr(os, "sysconf") or "SC_PHYS_PAGES" not in os.sysconf_names:
        return ""
    return f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 1e9:.1f} GB"


def _compiler() -> str:
    program = shutil.which(os.environ.get("CC") or "cc") or shutil.which("gcc")
    if program is None:
        return ""
    output = subprocess.run([program, "--version"], capture_output=True, text=True, check=False).stdout
    return output.splitlines()[0] if output else ""
