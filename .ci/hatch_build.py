"""What hatchling calls when the package is built or installed from its sources: the core is compiled beside them."""

from __future__ import annotations

import os
import runpy
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

__all__ = ["CoreHook"]


class CoreHook(BuildHookInterface[Any]):
    """Compiles the core; a wheel with it is one of a platform, one without is for all."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Put the library beside its sources; without a compiler, and with ``$SFETCAS_CORE=off``, it is left out."""
        if self.target_name != "wheel" or os.environ.get("SFETCAS_CORE") == "off":
            return
        # The package itself cannot be imported: what it needs is not installed yet.
        folder = Path(self.root) / "sfetcas" / "core"
        building = runpy.run_path(str(folder / "building.py"))
        beginning = building["prefix"]()
        for old in folder.glob(f"core-*{building['SUFFIX']}"):
            if not old.name.startswith(beginning):
                old.unlink()
        found = building["whole"](folder, beginning) or building["compile_core"](folder)
        if found is None:
            self.app.display_warning("no C compiler that works: sfetcas is installed without its core, and is slower")
            return
        build_data["artifacts"].append(f"/sfetcas/core/{found.name}")
        build_data["pure_python"] = False
        build_data["tag"] = "py3-none-" + sysconfig.get_platform().replace("-", "_").replace(".", "_")
