"""Exudyn on the problems of the comparison; part of ``python -m benchmarks compared``.

Plane elements are the ANCF cable (``cable2d``) and the geometrically exact beam with two and three nodes (``ge2d``,
``ge2d3``), the spatial one is geometrically exact with two nodes and quaternions (``ge3d``).  Of load steps, tolerances
and linear solvers all are tried, in motions steps and Newton's methods too.  It is the build without range checks.

Source: J. Gerstmayr, Exudyn - a C++-based Python package for flexible multibody systems, 2024.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import itertools
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sfetcas.description.records import counted
from sfetcas.description.scene import Scene
from sfetcas.mathematics import quaternion
from sfetcas.mathematics.arrays import Array

from .compared_problems import MOTION, NEAR, PENDULUM_STIFF, SAMPLES, STATICS, Candidate, Problem, Row, fastest

__all__ = ["rows"]

PROGRAM = "exudyn"

PLANE: dict[str, tuple[int, ...]] = {
    "cable2d": (8, 16, 24, 32, 48, 64, 96),
    "ge2d": (4, 8, 12, 16, 32, 64),
    "ge2d3": (2, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96),
}
SPACE: dict[str, tuple[int, ...]] = {"ge3d": (8, 12, 16, 32, 64, 128)}
"""Elements and their numbers."""

LOAD_STEPS = {"plane": (1, 2, 4, 8, 16), "space": (16, 24, 32)}
"""Numbers of equal load steps; fewer fail."""

RELATIVE = (1e-8, 1e-10)
"""Tolerances of residuals; smaller ones often cannot be reached."""

DENSE = 40
"""Largest number of nodes for which the dense solver is tried."""

PENDULUM_MESHES = {"cable2d": (12, 16, 24, 32), "ge2d3": (8, 12, 16, 24, 32)}
PENDULUM_STEPS = (5e-3, 2e-3, 1e-3, 5e-4)
PENDULUM_RELATIVE = (1e-4, 1e-6)
"""Meshes, steps in s and tolerances of the motion."""

SPECTRAL_RADIUS = 0.9
"""Of the generalised-alpha method."""

PENDULUM_FINE = (64, 1e-4, 1e-6)
"""Elements, step in s and tolerance of the solution that stands for the exact one."""


@dataclass(frozen=True)
class _Beams:
    """An assembled system, and the numbers in it of the compared node, of the force and of the sensor of a motion."""

    exu: Any
    system: Any
    node: int
    force: int | None = None
    sensor: int | None = None

    def place(self) -> Array:
        """Position (3,) of the node, m."""
        return np.asarray(self.system.GetNodeOutput(self.node, self.exu.OutputVariableType.Position))

    def statics(self, settings: Any, **more: Any) -> bool:
        """Whether equilibrium was found; a failure may also be an exception."""
        try:
            return bool(self.system.SolveStatic(settings, storeSolver=False, showCausingItems=False, **more))
        except (RuntimeError, ValueError):
            return False

    def motion(self, settings: Any) -> bool:
        """Whether the motion was followed to its end."""
        try:
            return bool(self.system.SolveDynamic(settings, storeSolver=False, showCausingItems=False))
        except (RuntimeError, ValueError):
            return False

    def path(self) -> Array:
        """Positions (samples, 2) of the node at the times of :data:`SAMPLES`, m."""
        stored = np.asarray(self.system.GetSensorStoredData(self.sensor))
        return stored[np.searchsorted(stored[:, 0], SAMPLES - 1e-6), 1:3]


def _exudyn() -> tuple[Any, Any]:
    """The program and its items.

    Raises
    ------
    ImportError
        It is not installed.
    """
    # Read at the import, which then prints so.
    sys.exudynFast = True  # type: ignore[attr-defined]
    with contextlib.redirect_stdout(io.StringIO()):
        exu = importlib.import_module("exudyn")
        items = importlib.import_module("exudyn.itemInterface")
    exu.config.printToConsole = False
    return exu, items


def _node(items: Any, element: str, place: Array, turned: Array) -> Any:
    tangent = quaternion.matrix(turned[None])[0][:, 0]
    if element == "cable2d":
        return items.NodePoint2DSlope1(referenceCoordinates=[*place[:2], *tangent[:2]])
    if element == "ge3d":
        return items.NodeRigidBodyEP(referenceCoordinates=[*place, *turned])
    return items.NodeRigidBody2D(referenceCoordinates=[*place[:2], np.arctan2(tangent[1], tangent[0])])


def _element(exu: Any, items: Any, element: str, section: Any, stiffness: float, **given: Any) -> Any:
    mass = section.rhoA or 1.0
    inertia = section.rhoI[2] if section.rhoI else 1.0
    if element == "cable2d":
        return items.ObjectANCFCable2D(
            massPerLength=mass, bendingStiffness=section.EI3, axialStiffness=stiffness, **given
        )
    if element == "ge3d":
        made = exu.BeamSection()
        made.massPerLength, made.inertia = mass, np.eye(3)
        made.stiffnessMatrix = np.diag([stiffness] * 3 + [section.GJ, section.EI2, section.EI3])
        return items.ObjectBeamGeometricallyExact(sectionData=made, **given)
    return items.ObjectBeamGeometricallyExact2D(
        massPerLength=mass,
        crossSectionInertia=inertia,
        bendingStiffness=section.EI3,
        axialStiffness=stiffness,
        shearStiffness=stiffness,
        **given,
    )


def _built(scene: Scene, watched: str, element: str, elements: int, stiffness: float) -> _Beams:
    """The members of a scene, each of so many elements, with its supports, its force and its gravity."""
    exu, items = _exudyn()
    system = exu.SystemContainer().AddSystem()
    ground = system.AddObject(items.ObjectGround())
    fixed = system.AddNode(items.NodePointGround(referenceCoordinates=[0, 0, 0]))
    origin = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))
    ends: dict[str, int] = {}
    each = 2 if element == "ge2d3" else 1
    for name, member in scene.members.items():
        line, section = scene.center_lines[name], scene.sections[str(member.section)]
        x = np.linspace(0.0, 1.0, each * elements + 1)
        numbers = []
        for i, (place, turned) in enumerate(zip(line.positions(x), line.quaternions(x))):
            end = {0: member.nodes[0], len(x) - 1: member.nodes[1]}.get(i)
            number = ends[end] if end in ends else system.AddNode(_node(items, element, place, turned))
            numbers.append(number)
            if end is not None:
                ends[end] = number
        for i in range(0, each * elements, each):
            given = {"nodeNumbers": numbers[i : i + each + 1], "length": line.length / elements}
            beam = system.AddObject(_element(exu, items, element, section, stiffness, **given))
            if scene.gravity is not None:
                body = system.AddMarker(items.MarkerBodyMass(bodyNumber=beam))
                system.AddLoad(items.Gravity(markerNumber=body, loadVector=list(scene.gravity)))
    for name, node in scene.nodes.items():
        if node.support == "clamped" and element == "ge3d":
            here = system.AddMarker(items.MarkerNodeRigid(nodeNumber=ends[name]))
            there = system.AddMarker(items.MarkerBodyRigid(bodyNumber=ground, localPosition=list(node.position)))
            system.AddObject(items.GenericJoint(markerNumbers=[there, here]))
            continue
        # Of a slope its component across the tangent, which is along x here.
        turning = 3 if element == "cable2d" else 2
        held = {"clamped": (0, 1, turning), "hinge": (0, 1), "slider": (1,), "free": ()}[node.support]
        for coordinate in held:
            here = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ends[name], coordinate=coordinate))
            system.AddObject(items.CoordinateConstraint(markerNumbers=[origin, here]))
    numbers_of: dict[str, int] = {}
    for load in scene.loads.values():
        marker = system.AddMarker(items.MarkerNodePosition(nodeNumber=ends[str(load.node)]))
        numbers_of["force"] = system.AddLoad(items.Force(markerNumber=marker, loadVector=list(load.vector)))
    if scene.gravity is not None:
        kind = {"outputVariableType": exu.OutputVariableType.Position, "storeInternal": True, "writeToFile": False}
        numbers_of["sensor"] = system.AddSensor(items.SensorNode(nodeNumber=ends[watched], **kind))
    system.Assemble()
    return _Beams(exu, system, ends[watched], **numbers_of)


def _settings(exu: Any, relative: float, dense: bool) -> Any:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.parallel.numberOfThreads = 1
    settings.staticSolver.numberOfLoadSteps = 1
    kinds = exu.LinearSolverType
    settings.linearSolver.solverType = kinds.EXUdense if dense else kinds.EigenSparse
    for solver in (settings.staticSolver, settings.timeIntegration):
        solver.verboseMode = 0
        solver.adaptiveStep = False
        solver.newton.relativeTolerance, solver.newton.absoluteTolerance = relative, 1e-10
    return settings


def _candidate(setting: str, run: Callable[[], bool], error: Callable[[], float]) -> Candidate | None:
    """A setting with the least of two times; nothing where a solve fails."""
    seconds = np.inf
    for _ in range(2):
        begin = time.perf_counter()
        if not run():
            return None
        seconds = min(seconds, time.perf_counter() - begin)
    return Candidate(setting, error(), seconds, run)


def rows(name: str) -> list[Row]:
    """The rows of a problem by its name."""
    return _pendulum_rows() if name == MOTION.name else _static_rows(STATICS[name])


def _static_rows(problem: Problem) -> list[Row]:
    found: dict[str, list[Candidate]] = {"cold": [], "warm": []}
    for element, counts in (SPACE if problem.scene.dimension == "space" else PLANE).items():
        exact = problem.exact(problem.stiffness, np.inf if element == "cable2d" else problem.stiffness)
        for count in counts:
            for kind, each in _static(problem, element, count, exact):
                found[kind].append(each)
    return [row for kind, each in found.items() for row in fastest(problem, PROGRAM, kind, each)]


def _static(problem: Problem, element: str, count: int, exact: Array) -> Iterator[tuple[str, Candidate]]:
    """Cold solves on one mesh with all settings, and warm ones with the linear solver of the fastest."""
    each = count // len(problem.scene.members)
    beams, near = (_built(problem.scene, problem.node, element, each, problem.stiffness) for _ in range(2))
    dimension = problem.scene.dimension
    best: tuple[float, int, bool] | None = None
    for steps, relative, dense in itertools.product(LOAD_STEPS[dimension], RELATIVE, (True, False)):
        if dense and beams.system.systemData.NumberOfNodes() > DENSE:
            continue
        settings = _settings(beams.exu, relative, dense)
        settings.staticSolver.numberOfLoadSteps = steps
        found = _candidate(
            f"{element}, {count} elements, {counted(steps, 'load step')}, {_solver(relative, dense)}",
            partial(beams.statics, settings),
            lambda: problem.error(beams.place(), exact),
        )
        if found is None or found.error > problem.targets[0]:
            # It failed, went to another equilibrium or is too coarse.
            continue
        yield "cold", found
        if best is None or found.seconds < best[0]:
            best = found.seconds, steps, dense
    if best is None:
        return
    _, steps, dense = best
    (load,) = problem.scene.loads.values()
    force = np.array(load.vector)
    settings = _settings(near.exu, RELATIVE[0], dense)
    settings.staticSolver.numberOfLoadSteps = steps
    near.system.SetLoadParameter(near.force, "loadVector", list(NEAR * force))
    near.statics(settings, updateInitialValues=True)
    near.system.SetLoadParameter(near.force, "loadVector", list(force))
    for relative in RELATIVE:
        warm = _candidate(
            f"{element}, {count} elements, {_solver(relative, dense)}",
            partial(near.statics, _settings(near.exu, relative, dense)),
            lambda: problem.error(near.place(), exact),
        )
        if warm is not None:
            yield "warm", warm


def _solver(relative: float, dense: bool) -> str:
    return f"tolerance {relative:.0e}, {'dense' if dense else 'sparse'}"


def _pendulum_rows() -> list[Row]:
    """The rows of the pendulum; the exact solution of an element's model is that on a far finer mesh."""
    candidates: list[Candidate] = []
    for element, counts in PENDULUM_MESHES.items():
        fine, step, relative = PENDULUM_FINE
        reference = _pendulum(element, fine)
        if not reference.motion(_stepping(reference.exu, step, relative, dense=False, modified=True)):
            continue
        exact = reference.path()
        for count in counts:
            for step in PENDULUM_STEPS:
                candidates += _motions(_pendulum(element, count), f"{element}, {count} elements", step, exact)
    return fastest(MOTION, PROGRAM, "cold", candidates)


def _pendulum(element: str, elements: int) -> _Beams:
    return _built(MOTION.scene, MOTION.node, element, elements, PENDULUM_STIFF)


def _stepping(exu: Any, step: float, relative: float, *, dense: bool, modified: bool) -> Any:
    settings = _settings(exu, relative, dense)
    end = float(SAMPLES[-1])
    settings.solution.sensors.writePeriod = SAMPLES[0]
    course = settings.timeIntegration
    course.endTime, course.numberOfSteps = end, round(end / step)
    course.newton.useModifiedNewton = modified
    course.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    course.generalizedAlpha.computeInitialAccelerations = True
    return settings


def _motions(beams: _Beams, mesh: str, step: float, exact: Array) -> Iterator[Candidate]:
    """The generalised-alpha method with one step and all other settings."""
    for relative, dense, modified in itertools.product(PENDULUM_RELATIVE, (True, False), (True, False)):
        settings = _stepping(beams.exu, step, relative, dense=dense, modified=modified)
        newton = "modified Newton" if modified else "Newton"
        found = _candidate(
            f"{mesh}, steps of {1e3 * step:g} ms, {newton}, {_solver(relative, dense)}",
            partial(beams.motion, settings),
            lambda: float(np.abs(beams.path() - exact).max()),
        )
        if found is not None:
            yield found
