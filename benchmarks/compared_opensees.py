"""OpenSees on the problems of the comparison; part of ``python -m benchmarks compared``.

Elastic beam-columns with the corotational transformation, which stretch and do not shear; a bend is a polygon of them.
Of load steps and systems of equations all are tried.

Where the system has no BLAS, ``LD_LIBRARY_PATH`` has to name the folder ``openseespylinux/lib`` of the installation.

Source: F. McKenna, OpenSees: a framework for earthquake engineering simulation, 2011.
"""

from __future__ import annotations

import importlib
import itertools
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from sfetcas.description.records import counted
from sfetcas.mathematics.arrays import Array

from .compared_problems import NEAR, STATICS, Candidate, Problem, Row, fastest

__all__ = ["rows"]

PROGRAM = "openseespy"

COUNTS = {"plane": (8, 12, 16, 24, 32, 64, 96, 128, 192), "space": (8, 12, 16, 32, 64, 96, 128)}
"""Numbers of elements."""

LOAD_STEPS = {"plane": (1, 2, 4, 8), "space": (1, 2, 4, 8, 16)}
"""Numbers of equal load steps."""

SYSTEMS = ("BandGeneral", "BandSPD", "SparseSYM", "UmfPack")
"""Solvers of linear equations."""

TOLERANCE = 1e-7
"""Of the displacements of a Newton step, over the length; the error after a step is about its square."""

ITERATIONS = 30


def _opensees() -> Any:
    """The program.

    Raises
    ------
    ImportError
        It is not installed.
    RuntimeError
        A library that it needs is missing.
    """
    program = importlib.import_module("openseespy.opensees")
    # It tells of each step that fails.
    program.logFile("/dev/null", "-noEcho")
    return program


def rows(name: str) -> list[Row]:
    """The rows of an equilibrium problem by its name."""
    problem = STATICS[name]
    exact = problem.exact(problem.stiffness)
    found: dict[str, list[Candidate]] = {"cold": [], "warm": []}
    for count in COUNTS[problem.scene.dimension]:
        for kind, each in _static(problem, count, exact):
            found[kind].append(each)
    return [row for kind, each in found.items() for row in fastest(problem, PROGRAM, kind, each)]


def _built(program: Any, problem: Problem, count: int) -> int:
    """The members of a scene of so many elements in all, with its supports and its force; the compared node."""
    scene, space = problem.scene, problem.scene.dimension == "space"
    axes = 3 if space else 2
    program.wipe()
    program.model("basic", "-ndm", axes, "-ndf", 6 if space else 3)
    # In space one of its arguments is a vector in the plane of the local x and z axes.
    program.geomTransf("Corotational", 1, *((0.0, 0.0, 1.0) if space else ()))
    ends: dict[str, int] = {}
    nodes, beams = itertools.count(1), itertools.count(1)
    for name, member in scene.members.items():
        line, section = scene.center_lines[name], scene.sections[str(member.section)]
        x = np.linspace(0.0, 1.0, count // len(scene.members) + 1)
        numbers = []
        for i, place in enumerate(line.positions(x)):
            end = {0: member.nodes[0], len(x) - 1: member.nodes[1]}.get(i)
            if end in ends:
                numbers.append(ends[end])
                continue
            numbers.append(next(nodes))
            program.node(numbers[-1], *map(float, place[:axes]))
            if end is not None:
                ends[end] = numbers[-1]
        # Areas and moduli: EA, E = 1, then G = 1, GJ, EI, EI in space and EI in the plane.
        bending = (1.0, section.GJ, section.EI2, section.EI3) if space else (section.EI3,)
        for pair in itertools.pairwise(numbers):
            program.element("elasticBeamColumn", next(beams), *pair, problem.stiffness, 1.0, *bending, 1)
    for name, node in scene.nodes.items():
        held = {"clamped": [1] * 6, "hinge": [1, 1, 0], "slider": [0, 1, 0], "free": [0] * 6}[node.support]
        program.fix(ends[name], *held[: 6 if space else 3])
    (load,) = scene.loads.values()
    program.timeSeries("Linear", 1)
    program.pattern("Plain", 1, 1)
    program.load(ends[str(load.node)], *load.vector[:axes], *([0.0] * (axes if space else 1)))
    return ends[problem.node]


class _Analysis:
    """The static analysis of a problem on one mesh; the program holds one model at a time, that of :meth:`ready`."""

    def __init__(self, problem: Problem, count: int, system: str, steps: int) -> None:
        self.problem, self.count, self.system, self.steps = problem, count, system, steps
        self.program = _opensees()
        self.node = 0
        self.ahead = True

    def ready(self) -> None:
        """Build the model, to be loaded in equal steps."""
        program = self.program
        self.node = _built(program, self.problem, self.count)
        program.constraints("Plain")
        program.numberer("RCM")
        program.system(self.system)
        program.test("NormDispIncr", TOLERANCE * self.problem.length, ITERATIONS)
        program.algorithm("Newton")
        program.integrator("LoadControl", 1.0 / self.steps)
        program.analysis("Static", "-noWarnings")

    def cold(self) -> bool:
        """Whether the load is reached from the undeformed state."""
        self.program.reset()
        return self.program.analyze(self.steps) == 0

    def near(self) -> None:
        """Build the model and load it nearly."""
        self.ready()
        self.program.integrator("LoadControl", NEAR / self.steps)
        self.program.analyze(self.steps)
        self.ahead = True

    def warm(self) -> bool:
        """Whether the load is reached from nearly as much, or by the next call the other way round."""
        self.program.integrator("LoadControl", (1.0 - NEAR) * (1.0 if self.ahead else -1.0))
        self.ahead = not self.ahead
        return self.program.analyze(1) == 0

    def error(self, exact: Array) -> float:
        """Of the compared node, over the length."""
        place = np.array(self.program.nodeCoord(self.node))
        place += np.array(self.program.nodeDisp(self.node))[: len(place)]
        return self.problem.error(place, exact[: len(place)])


def _static(problem: Problem, count: int, exact: Array) -> Iterator[tuple[str, Candidate]]:
    """Cold and warm solves on one mesh with all settings."""
    for system, steps in itertools.product(SYSTEMS, LOAD_STEPS[problem.scene.dimension]):
        analysis = _Analysis(problem, count, system, steps)
        mesh = f"elasticBeamColumn, {count} elements"
        for kind, ready, run, words in (
            ("cold", analysis.ready, analysis.cold, f"{mesh}, {counted(steps, 'load step')}, {system}"),
            ("warm", analysis.near, analysis.warm, f"{mesh}, {system}"),
        ):
            ready()
            begin = time.perf_counter()
            if not run():
                break
            seconds, error = time.perf_counter() - begin, analysis.error(exact)
            if error > problem.targets[0]:
                # It went to another equilibrium, or is too coarse.
                break
            yield kind, Candidate(words, error, seconds, run, ready)
