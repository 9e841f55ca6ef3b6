"""What a sweep costs beside its solves; part of ``python -m benchmarks``."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
from collections.abc import Iterator
from concurrent.futures import Executor

import numpy as np

from sfetcas.description.scene import Load, Member, Node, Scene
from sfetcas.description.sections import CrossSection
from sfetcas.processes import cores
from sfetcas.sweeps.cases import sampled
from sfetcas.sweeps.distributions import Normal, Uniform
from sfetcas.sweeps.result import Sweep
from sfetcas.sweeps.sweeping import sweep
from sfetcas.tradeoff.tables import markdown_table

__all__ = ["many"]

CASES = 1000

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
