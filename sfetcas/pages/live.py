"""Live pages: the generated solver of a scene as WebAssembly, with what the viewer needs to run it.

The same C as of :func:`sfetcas.export`, with a few functions that a page can call.
"""

from __future__ import annotations

import base64
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..codegen.folder import export
from ..description.loads import Load, Motion
from ..description.records import plain
from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..parametric.arguments import Argument, Asked
from ..parametric.equilibrium import EquilibriumSolver

__all__ = ["check_live", "live_of"]

NAME = "live"

GLUE = """#include <string.h>
#include "live.h"
static live_memory memory;
static double arguments[LIVE_ARGUMENTS], results[LIVE_RESULTS], state[LIVE_STATE], kept[LIVE_STATE];
static live_report report;
double *live_arguments(void) { return arguments; }
double *live_results(void) { return results; }
live_report *live_report_of(void) { return &report; }
void live_keep(void) { memcpy(kept, state, sizeof state); }
void live_back(void) { memcpy(state, kept, sizeof state); }
int live_solve_now(int warm) { return live_solve(&memory, arguments, state, warm, results, &report); }
"""

EXPORTED = ("live_arguments", "live_results", "live_report_of", "live_keep", "live_back", "live_solve_now")
"""Functions that a page calls."""

MISSING = (
    "found no compiler for WebAssembly, accepted: after pip install 'sfetcas[page]', or with the programs clang and "
    "wasm-ld and a library wasi-libc"
)

SYSROOTS = ("/usr", "/opt/wasi-sysroot", "/opt/wasi-sdk/share/wasi-sysroot")
"""Where a library for WebAssembly may be, beside what WASI_SYSROOT says."""


def check_live(scene: Scene) -> None:
    """Refuse what no live page shows.

    Raises
    ------
    SceneError
        The analysis is not static, a rigid member is curved, or there is no compiler.
    """
    kind = scene.analysis.type
    if kind != "static":
        raise SceneError(f"found the analysis {kind!r}, accepted: 'static'", ("live",))
    for name, member in scene.members.items():
        if member.type != "flexible" and scene.center_lines[name].turning:
            raise SceneError(
                f"found the {member.type} member {name!r} that is curved, accepted: straight ones", ("live",)
            )
    _compiler()


def live_of(
    scene: Scene, places: Mapping[str, Array], arguments: Asked = None, settings: Settings | None = None
) -> Any:
    """A solver of a scene as WebAssembly, and what its numbers mean.

    Parameters
    ----------
    scene : Scene
    places : mapping of members to fractions (n,) of their length where they are shown
    arguments, settings
        As of :func:`sfetcas.export`.

    Returns
    -------
    dict
        ``module``, base64; ``arguments``, ``results`` and ``statuses`` as of the manifest of an export; ``handles``:
        which of the arguments are forces and displacements of nodes that can be dragged; ``factor`` of the scene where
        that is no argument; ``tangents`` of the undeformed flexible members at their places, by their names.

    Raises
    ------
    SceneError
        As :func:`sfetcas.export`; there is no compiler, or it fails.  :func:`check_live` has to accept the scene.
    """
    flexible = {name: x for name, x in places.items() if scene.members[name].type == "flexible"}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / NAME
        asked = {name: x.tolist() for name, x in flexible.items()}
        made = export(scene, folder, name=NAME, arguments=arguments, places=asked, settings=settings)
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        (folder / "glue.c").write_text(GLUE, encoding="utf-8")
        module = _compiled(folder)
    assert isinstance(made, EquilibriumSolver)
    spans = {one.name: _spans(one) for one in made.arguments.arguments}
    tangents = {name: scene.center_lines[name].tangents(x).ravel().tolist() for name, x in flexible.items()}
    return {
        "module": base64.b64encode(module).decode(),
        "arguments": [
            {key: one[key] for key in ("name", "unit", "first", "size", "default")} | {"spans": spans[one["name"]]}
            for one in manifest["arguments"]
        ],
        "handles": _handles(scene, manifest["arguments"]),
        "factor": scene.analysis.steps[-1],
        "results": [{key: one[key] for key in ("name", "first", "size", "shape")} for one in manifest["results"]],
        "statuses": manifest["statuses"],
        "tangents": tangents,
    }


def _handles(scene: Scene, arguments: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Dead forces on nodes and displacements of nodes of which numbers are arguments, each once.

    ``value`` is the vector in the scene, ``parts`` which of its components are which numbers of the arguments.
    """
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for one in arguments:
        table, _, rest = one["name"].partition(".")
        record, _, rest = rest.partition(".")
        key, _, component = rest.partition(".")
        acts: Load | Motion
        value: Any
        if (table, key) == ("loads", "value"):
            acts = scene.loads[record]
            value, held = acts.value, acts.type == "force" and acts.node is not None and acts.frame == "fixed"
        elif (table, key) == ("motions", "displacement"):
            acts = scene.motions[record]
            value, held = acts.displacement, scene.nodes[acts.node].support != "free"
        else:
            continue
        if held:
            kind = "force" if table == "loads" else "place"
            vector = {
                "kind": kind,
                "node": acts.node,
                "grows": acts.history is None,
                "value": plain(value),
                "parts": [],
            }
            axes = [int(component)] if component else one.get("components") or range(one["size"])
            parts = found.setdefault((table, record), vector)["parts"]
            parts += [[axis, one["first"] + i] for i, axis in enumerate(axes)]
    return list(found.values())


def _spans(argument: Argument) -> list[list[float]]:
    """Least and largest value that a page offers of each number of an argument: its range, or up to twice its value."""
    size = max(map(abs, argument.default)) or 1.0
    found = []
    for value, (low, high) in zip(argument.default, argument.limits.tolist(), strict=True):
        usual = (min(0.0, 2.0 * value), max(0.0, 2.0 * value)) if value else (-size, size)
        ranged = argument.low is not None and argument.high is not None
        found.append([low, high] if ranged else [max(low, usual[0]), min(high, usual[1])])
    return found


def _compiler() -> list[str]:
    """The command of a compiler for WebAssembly.

    Raises
    ------
    SceneError
        There is none.
    """
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi"]
    if shutil.which("clang") and shutil.which("wasm-ld"):
        for root in filter(None, (os.environ.get("WASI_SYSROOT"), *SYSROOTS)):
            if (Path(root) / "include" / "wasm32-wasi").is_dir():
                return ["clang", "--target=wasm32-wasi", f"--sysroot={root}"]
    raise SceneError(MISSING, ("live",))


def _compiled(folder: Path) -> bytes:
    """The module that is made of the C files of a folder."""
    exports = [f"-Wl,--export={name}" for name in EXPORTED]
    words: Sequence[str] = [*_compiler(), "-O2", "-mexec-model=reactor", "-Wl,--strip-all", *exports]
    words = [*words, f"{NAME}.c", "glue.c", "-o", "live.wasm"]
    environment = {**os.environ, "ZIG_LOCAL_CACHE_DIR": str(folder / "cache")}
    ran = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if ran.returncode:
        said = [line for line in ran.stderr.splitlines() if line.strip()]
        raise SceneError(f"the compiler for WebAssembly failed: {said[-1] if said else ran.returncode}", ("live",))
    return (folder / "live.wasm").read_bytes()
