"""Answers for ParaView: a file with the centre lines of all members for each, and a collection that lists them.

The files are written by pyevtk (the extra ``vtk``): it needs nothing but NumPy and writes both kinds.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path as File

import numpy as np
from pyevtk.vtk import VtkFile, VtkGroup, VtkPolyLine, VtkUnstructuredGrid

from ..dynamics.motion import MotionState, Trajectory
from ..equilibria.solution import Configuration, Solution
from ..mathematics.arrays import Array
from ..paths.path import Path

__all__ = ["save_vtk"]

COLLECTION = "answers"
PLACES = np.linspace(0.0, 1.0, 21)
"""Fractions of the length at which there are points, beside the nodes of the elements."""


def save_vtk(answer: Solution | Path | Trajectory, folder: str | os.PathLike[str]) -> None:
    """Write ``answers.pvd`` and its ``answer_0000.vtu``, ... into a folder, which is made where it is not there.

    Each member is a polyline, its number in ``member``; at its points stand ``s`` (fraction of the length),
    ``quaternion`` (w, x, y, z), ``force`` N, ``moment`` N m, ``curvature`` 1/m about the section axes and, of a
    motion, ``velocity`` m/s.  The time of the collection is that
    of a motion, s; of steps and of the points of a path it is their number, and ``factor`` their factor.
    """
    File(folder).mkdir(exist_ok=True)
    group = VtkGroup(str(File(folder) / COLLECTION))
    for number, (time, step) in enumerate(_timed(answer)):
        name = str(File(folder) / f"answer_{number:04d}")
        _write(name, step)
        group.addFile(filepath=f"{name}.vtu", sim_time=time)
    group.save()


def _timed(answer: Solution | Path | Trajectory) -> Iterator[tuple[float, Configuration]]:
    if isinstance(answer, Trajectory):
        yield from ((step.time, step) for step in answer.steps)
    elif isinstance(answer, Path):
        yield from ((float(i), answer.configuration(point)) for i, point in enumerate(answer.points))
    else:
        yield from ((float(i), step) for i, step in enumerate(answer.steps))


def _write(name: str, step: Configuration) -> None:
    lines = [_line(step, member) for member in step.model.scene.members]
    points = {key: np.concatenate([line[key] for line in lines]) for key in lines[0]}
    places = points.pop("position")
    offsets = np.cumsum([len(line["s"]) for line in lines]).astype("int32")
    cells = {
        "connectivity": np.arange(len(places), dtype="int32"),
        "offsets": offsets,
        "types": np.full(len(lines), VtkPolyLine.tid, dtype="uint8"),
    }
    of_cells = {"member": np.arange(len(lines), dtype="int32")}
    of_all = {} if isinstance(step, MotionState) else {"factor": np.array([step.factor])}
    file = VtkFile(name, VtkUnstructuredGrid)
    file.openGrid()
    # Of the whole grid: it stands before its piece.
    file.openData("Field")
    _declare(file, of_all)
    file.closeData("Field")
    file.openPiece(ncells=len(lines), npoints=len(places))
    for element, table in (("Points", {"points": places}), ("Cells", cells)):
        file.openElement(element)
        _declare(file, table)
        file.closeElement(element)
    for kind, table in (("Point", points), ("Cell", of_cells)):
        file.openData(kind)
        _declare(file, table)
        file.closeData(kind)
    file.closePiece()
    file.closeGrid()
    for table in (of_all, {"points": places}, cells, points, of_cells):
        for values in table.values():
            file.appendData(values.ravel())
    file.save()


def _declare(file: VtkFile, table: dict[str, Array]) -> None:
    for name, values in table.items():
        file.addHeader(name, values.dtype.name, len(values), 1 if values.ndim == 1 else values.shape[1])


def _line(step: Configuration, member: str) -> dict[str, Array]:
    """What is told along a member, each (n,) or (n, components)."""
    s = np.unique(np.concatenate([PLACES, step.model.along(member)]))
    found = step.along(member, s)
    table = {"s": s, **{key: found[key] for key in ("position", "quaternion", "force", "moment", "curvature")}}
    if isinstance(step, MotionState):
        table["velocity"] = found["velocity"] if "velocity" in found else _velocities(step, member, s)
    return {key: np.ascontiguousarray(values, dtype=float) for key, values in table.items()}


def _velocities(step: MotionState, member: str, s: Array) -> Array:
    """Velocities (n, 3) along a small member, linear between its ends."""
    nodes = step.model.scene.members[member].nodes
    ends = np.array([step.velocity(nodes[0]), step.velocity(nodes[-1])])
    return (1.0 - s)[:, None] * ends[0] + s[:, None] * ends[1]
