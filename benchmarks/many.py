"""What a sweep costs beside its solves, and what a case costs in a batch; part of ``python -m benchmarks``."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import resource
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from sfetcas import load
from sfetcas.description.scene import Load, Member, Node, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.processes import cores
from sfetcas.sweeps.cases import grid, sampled
from sfetcas.sweeps.distributions import Normal, Uniform
from sfetcas.sweeps.result import Sweep
from sfetcas.sweeps.sweeping import sweep
from sfetcas.tradeoff.tables import markdown_table

from .saving import head, row

__all__ = ["batch", "many"]

CASES = 1000

ACCURACY = 1e-6

MANY, FEWER = 1000, 100
"""Values of each of two numbers in batches."""

PROBLEMS = Path(__file__).parent.parent / "problems"

QUANTITIES = ("nodes.tip.position", "members.beam.moment at 0")


def bar(dimension: str) -> Scene:
    """A cantilever of unit length with a force across it."""
    return Scene(
        dimension=dimension,
        sections={"unit": CrossSection(EI2=1.0, EI3=1.0, GJ=1.0)},
        nodes={"root": Node(position=[0, 0], support="clamped"), "tip": Node(position=[1, 0])},
        members={"beam": Member(nodes=["root", "tip"], section="unit")},
        loads={"tip": Load(type="force", node="tip", value=[0, 5])},
    )


def many() -> None:
    """Wall time of a thousand equilibria, drawn at random, against the sum of their solves."""
    print(f"Sweeps of {CASES} equilibria by {cores()} processes, whose start counts (that of Dask's does not)\n")
    cases = sampled(CASES, {"sections.unit.EI3": Normal(1.0, 0.05), "loads.tip.value.1": Uniform(0.0, 10.0)})
    rows = []
    for dimension in ("plane", "space"):
        first: Sweep | None = None
        for name in ("processes", "Dask", "batch", "batch, warm"):
            if name == "Dask" and importlib.util.find_spec("distributed") is None:
                continue
            with _dask() if name == "Dask" else contextlib.nullcontext() as executor:
                more = {"batch": name.startswith("batch"), "warm": name.endswith("warm")}
                found = sweep(bar(dimension), cases, QUANTITIES, executor=executor, **more)
            rows.append((dimension, name, *_cells(found, first or found)))
            first = first or found
    heads = ("cantilever", "executor", "s", "s of solves", "ms a solve", "overhead", "numbers")
    print("\n".join(markdown_table(heads, rows)))


def batch() -> None:
    """A million equilibria of a cantilever over two numbers, and 10,000 of a robot with two tendons, by the core."""
    print(f"Sweeps in batches by {cores()} threads, each case certified, at an accuracy of {ACCURACY:g}: seconds, and")
    print("milliseconds of processor time a case\n")
    beam, robot = (load(PROBLEMS / f"{name}.toml") for name in ("cantilever_tip_force", "tendon_robot_along"))
    asked = {
        "cantilever": (beam, {"loads.tip.value.1": (-12.0, 12.0), "sections.strip.EI3": (0.8, 1.5)}, MANY),
        "tendon robot": (robot, {"tendons.short.tension": (0.1, 4.0), "tendons.long.tension": (0.1, 4.0)}, FEWER),
    }
    head("scene", "cases", "start", "s", "CPU ms", "solved one by one", "largest error estimate", "npz", "memory")
    for name, (scene, spans, side) in asked.items():
        cases = grid({key: np.linspace(*span, side) for key, span in spans.items()})
        for warm in (False, True):
            begin, spent = time.perf_counter(), time.process_time()
            scene = scene.replace({"analysis.accuracy": ACCURACY, "analysis.steps": [1.0], "expect": ()})
            found = sweep(scene, cases, ["nodes.tip.position"], batch=True, warm=warm)
            wall, spent = time.perf_counter() - begin, time.process_time() - spent
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "cases.npz"
                found.save(path)
                size = path.stat().st_size / 1e6
            most = float(np.nanmax(found.table["error_estimate"]))
            times = (f"{wall:.1f}", f"{1e3 * spent / len(found):.2f}", str(len(found.outcomes.own)))
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
            row(
                name,
                str(len(found)),
                "near" if warm else "zero",
                *times,
                f"{most:.1e}",
                f"{size:.0f} MB",
                f"{peak:.0f} MB",
            )


def _cells(found: Sweep, first: Sweep) -> tuple[str, ...]:
    solves = float(np.nansum(found.table["seconds"]))
    overhead = cores() * found.wall / solves - 1.0
    same = all(np.array_equal(found.values(name), first.values(name)) for name in QUANTITIES)
    each = 1e3 * solves / len(found)
    answers = "the same" if same else "others"
    return f"{found.wall:.2f}", f"{solves:.2f}", f"{each:.1f}", f"{100.0 * overhead:.1f} %", answers


@contextlib.contextmanager
def _dask() -> Iterator[Executor]:
    """A cluster of this machine."""
    dask = importlib.import_module("distributed")
    local = dask.LocalCluster(n_workers=cores(), threads_per_worker=1, dashboard_address=None)
    with local as cluster, dask.Client(cluster) as client:
        yield client.get_executor()
