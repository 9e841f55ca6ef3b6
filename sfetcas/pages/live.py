"""Live pages: the generated solver of a scene, or the steps of its motion, as WebAssembly, with what the viewer needs
to run it.

The same C as of :func:`sfetcas.export`, with a few functions that a page can call.
"""

from __future__ import annotations

import base64
import gzip
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..codegen.folder import export
from ..codegen.timestep import TimeStep, time_step
from ..description.loads import Load, Motion
from ..description.records import plain
from ..description.scene import Scene
from ..equilibria.settings import Settings
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..parametric.arguments import FACTOR, Argument, Asked, asked_for
from ..parametric.equilibrium import EquilibriumSolver, refuse_search

__all__ = ["check_ahead", "check_live", "live_of"]

NAME = "live"

GLUE = """#include <string.h>
#include "live.h"
static live_memory memory;
static double arguments[%s * LIVE_ARGUMENTS + 1], results[LIVE_RESULTS + 1], state[LIVE_STATE + 1];
static live_report report;
double *live_arguments(void) { return arguments; }
double *live_results(void) { return results; }
live_report *live_report_of(void) { return &report; }
"""

OF_EQUILIBRIA = """static double kept[LIVE_STATE + 1];
void live_keep(void) { memcpy(kept, state, sizeof state); }
void live_back(void) { memcpy(state, kept, sizeof state); }
int live_solve_now(int warm) { return live_solve(&memory, arguments, state, warm, results, &report); }
"""

OF_MOTION = """void live_start(void) { live_begin(state); }
void live_fresh(void) { live_refresh(state); }
void live_tell_now(void) { live_tell(&memory, arguments, state, results); }
int live_step_now(double h) { return live_step_through(&memory, h, arguments, state, results, &report); }
"""

MISSING = (
    "found no compiler for WebAssembly, accepted: after pip install 'sfetcas[page]', or with clang, wasm-ld, "
    "wasi-libc and compiler-rt for wasm32 (Debian: clang lld wasi-libc libclang-rt-dev-wasm32)"
)

SYSROOTS = ("/usr", "/opt/wasi-sysroot", "/opt/wasi-sdk/share/wasi-sysroot")
"""Where a library for WebAssembly may be, beside what WASI_SYSROOT says."""


LIVE_ANALYSES = ("static", "path", "dynamic")
"""Analyses that have live pages; of a path its equilibria are solved."""


def check_live(scene: Scene) -> None:
    """Refuse what no live page shows.

    Raises
    ------
    SceneError
        The analysis is that of modes, or there is no compiler.
    """
    kind = scene.analysis.type
    if kind not in LIVE_ANALYSES:
        raise SceneError(f"found the analysis {kind!r}, accepted: {', '.join(map(repr, LIVE_ANALYSES))}", ("live",))
    _compiler()


def check_ahead(scene: Scene, arguments: Asked, settings: Settings) -> None:
    """Refuse before anything is solved what :func:`live_of` would refuse of arguments and of the steps of a motion.

    Raises
    ------
    SceneError
        As of :func:`live_of`; :func:`check_live` has to accept the scene.
    """
    if scene.analysis.type == "dynamic":
        _refuse_short(time_step(scene, NAME, arguments=arguments, settings=settings))
    else:
        asked_for(scene, arguments)
        refuse_search(scene, stopped=True, touching=True)


def _refuse_short(made: TimeStep) -> None:
    """Refuse steps that are shorter than any that is taken."""
    if made.usual < made.shortest:
        message = f"found {made.usual:g} s, accepted of a live page: at least {made.shortest:.2g} s"
        raise SceneError(message, ("analysis", "step"))


def live_of(
    scene: Scene, places: Mapping[str, Array], arguments: Asked = None, settings: Settings | None = None
) -> Any:
    """A solver of a scene as WebAssembly, and what its numbers mean.

    Parameters
    ----------
    scene : Scene
    places : mapping of members to fractions (n,) of their length where they are shown
    arguments, settings
        As of :func:`sfetcas.export`; the histories of a motion are arguments anyway, as the page knows the time.

    Returns
    -------
    dict
        ``module``, zipped, base64; ``arguments``, ``results`` and ``statuses`` as of the manifest of an export;
        ``handles``: which of the arguments are forces and displacements of nodes that can be dragged; ``factor`` of the
        scene where that is no argument; ``tangents`` of the undeformed flexible members at their places, by their
        names; ``bodies``: the ``rest`` places of members that are curved and do not bend, and the ``node`` they turn
        with.  Of a motion ``step``, s, the ``times`` within a step at which arguments are needed, and the ``histories``
        by the names of their arguments.

    Raises
    ------
    SceneError
        As :func:`sfetcas.export`; there is no compiler, or it fails; no node tells how a curved rigid member in space
        turns; steps are shorter than any that is taken.  :func:`check_live` has to accept the scene.
    """
    flexible = {name: x for name, x in places.items() if scene.members[name].type == "flexible"}
    moving = scene.analysis.type == "dynamic"
    if moving and arguments is not None:
        spans = dict(arguments) if isinstance(arguments, Mapping) else dict.fromkeys(arguments)
        arguments = spans | {f"histories.{name}": None for name in scene.histories if f"histories.{name}" not in spans}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / NAME
        asked = {name: x.tolist() for name, x in flexible.items()}
        made = export(scene, folder, name=NAME, arguments=arguments, places=asked, settings=settings)
        if isinstance(made, TimeStep):
            _refuse_short(made)
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        glue = GLUE % ("LIVE_TIMES" if moving else "1") + (OF_MOTION if moving else OF_EQUILIBRIA)
        (folder / "glue.c").write_text(glue, encoding="utf-8")
        module = _compiled(folder, re.findall(r"(live_\w+)\([^()]*\) \{", glue))
    assert isinstance(made, EquilibriumSolver | TimeStep)
    offered = {one.name: _spans(scene, one) for one in made.arguments.arguments}
    if scene.analysis.range:
        # A path need not come to the factor of its loads.
        low, high = scene.analysis.range
        for one in manifest["arguments"]:
            if one["name"] == FACTOR:
                one["default"] = min(max(one["default"], low), high)
    tangents = {name: scene.center_lines[name].tangents(x).ravel().tolist() for name, x in flexible.items()}
    found = {
        "module": base64.b64encode(gzip.compress(module, mtime=0)).decode(),
        "arguments": [
            {key: one[key] for key in ("name", "unit", "first", "size", "default")} | {"spans": offered[one["name"]]}
            for one in manifest["arguments"]
        ],
        "handles": _handles(scene, manifest["arguments"]),
        "factor": scene.analysis.steps[-1],
        "results": [{key: one[key] for key in ("name", "first", "size", "shape")} for one in manifest["results"]],
        "statuses": manifest["statuses"],
        "tangents": tangents,
        "bodies": _bodies(scene, places, [one["name"] for one in manifest["results"]]),
    }
    if isinstance(made, TimeStep):
        histories = {f"histories.{name}": history for name, history in scene.histories.items()}
        found |= {"step": made.usual, "times": made.times.tolist()}
        found["histories"] = {
            name: {"t": history.t, "pieces": history.pieces, "value": history.factor(0.0)}
            for name, history in histories.items()
        }
    return found


def _bodies(scene: Scene, places: Mapping[str, Array], results: Sequence[str]) -> dict[str, Any]:
    """Curved members that are rigid, or nearly so: in the plane they turn as the line between their ends does."""
    found = {}
    rotation = "angle" if scene.resolved_dimension == "plane" else "quaternion"
    for name, member in scene.members.items():
        line = scene.center_lines[name]
        if member.type == "flexible" or line.turning == 0.0:
            continue
        ends = zip(member.nodes, member.release, strict=True)
        joined = [node for node, release in ends if release == "rigid" and f"nodes.{node}.{rotation}" in results]
        if not joined and (rotation == "quaternion" or np.allclose(*line.positions(np.array([0.0, 1.0])))):
            message = f"found the {member.type} member {name!r} that is curved and turns freely at all of its nodes"
            raise SceneError(f"{message}, accepted: straight, or rigidly joined to one of them", ("live",))
        found[name] = {"rest": line.positions(places[name]).ravel().tolist(), "node": next(iter(joined), None)}
    return found


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
                "history": acts.history,
                "value": plain(value),
                "parts": [],
            }
            axes = [int(component)] if component else one.get("components") or range(one["size"])
            parts = found.setdefault((table, record), vector)["parts"]
            parts += [[axis, one["first"] + i] for i, axis in enumerate(axes)]
    return list(found.values())


def _spans(scene: Scene, argument: Argument) -> list[list[float]]:
    """Least and largest value that a page offers of each number of an argument: its range, what a history or a path
    goes through, or up to twice its value.
    """
    table, _, name = argument.name.partition(".")
    through: list[float] = []
    if table == "histories" and scene.analysis.type == "dynamic":
        history = scene.histories[name]
        through = [history.factor(t) for one in pairwise(history.t) for t in np.linspace(*one, 9).tolist()]
    elif argument.name == FACTOR and scene.analysis.range:
        through = list(scene.analysis.range)
    size = max(map(abs, argument.default)) or 1.0
    found = []
    for value, (low, high) in zip(argument.default, argument.limits.tolist(), strict=True):
        usual = (min(0.0, 2.0 * value), max(0.0, 2.0 * value)) if value else (-size, size)
        if through and min(through) < max(through):
            usual = min(through), max(through)
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


def _compiled(folder: Path, names: Sequence[str]) -> bytes:
    """The module that is made of the C files of a folder, with functions of these names that a page calls."""
    exports = [f"-Wl,--export={name}" for name in names]
    words: Sequence[str] = [*_compiler(), "-O2", "-mexec-model=reactor", "-Wl,--strip-all", *exports]
    words = [*words, f"{NAME}.c", "glue.c", "-o", "live.wasm"]
    environment = {**os.environ, "ZIG_LOCAL_CACHE_DIR": str(folder / "cache")}
    ran = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if ran.returncode:
        said = [line for line in ran.stderr.splitlines() if line.strip()]
        # The first error says what is wrong, the last line that something was.
        first = next((line for line in said if "error" in line), said[-1] if said else ran.returncode)
        raise SceneError(f"the compiler for WebAssembly failed: {first}", ("live",))
    return (folder / "live.wasm").read_bytes()
