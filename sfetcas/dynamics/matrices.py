"""The matrices of small motion by name, in SI units: as arrays, as an ``.npz`` file, or as Matrix Market files.

Unknowns are rotations about the fixed axes (rad) and displacements (m); rows are constraints, those that close members
in m.  With ``x`` the unknowns and ``mu`` the multipliers

    mass x'' + (damping + gyroscopic) x' + stiffness x + constraint^T mu = 0,      constraint x = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..mathematics.linear import SparseMap
from ..mechanics.rotations import RotationFreedom
from .small_motion import SmallMotion

__all__ = ["Matrices", "matrices_of"]


@dataclass(frozen=True, eq=False)
class Matrices:
    """Matrices of the linearised equations of motion, in SI units.

    Attributes
    ----------
    parts : mapping of str to SparseMap
        ``mass``, ``damping``, ``gyroscopic``, ``stiffness`` (unknowns, unknowns), ``constraint`` (rows, unknowns).
    unknowns, rows : tuple of str
        A description of each unknown and each row.
    """

    parts: Mapping[str, SparseMap]
    unknowns: tuple[str, ...]
    rows: tuple[str, ...]

    def save(self, path: Path) -> None:
        """Write one ``.npz`` file, or into a folder a Matrix Market file for each matrix and lists of the names.

        In the file each matrix stands as ``NAME.row``, ``NAME.column``, ``NAME.value`` (from 0) and ``NAME.shape``,
        the names as ``unknowns`` and ``rows``.
        """
        if path.suffix == ".npz":
            arrays = {"unknowns": np.array(self.unknowns), "rows": np.array(self.rows)}
            for name, part in self.parts.items():
                arrays |= {f"{name}.row": part.row, f"{name}.column": part.column, f"{name}.value": part.value}
                arrays[f"{name}.shape"] = np.array(part.shape)
            with path.open("wb") as file:
                np.savez(file, **arrays)  # type: ignore[arg-type]  # names of arrays are free
            return
        path.mkdir(exist_ok=True)
        for name, part in self.parts.items():
            (path / f"{name}.mtx").write_text(_market(part))
        for kind, names in (("unknowns", self.unknowns), ("rows", self.rows)):
            (path / f"{kind}.txt").write_text("".join(f"{name}\n" for name in names))


def _market(matrix: SparseMap) -> str:
    lines = [
        "%%MatrixMarket matrix coordinate real general",
        f"{matrix.shape[0]} {matrix.shape[1]} {len(matrix.value)}",
    ]
    entries = zip(matrix.row, matrix.column, matrix.value, strict=True)
    return "\n".join([*lines, *(f"{r + 1} {c + 1} {v:.17g}" for r, c, v in entries)]) + "\n"


def matrices_of(motion: SmallMotion) -> Matrices:
    """The matrices of a small motion in SI units."""
    model, equations, masses = motion.model, motion.equations, motion.masses
    length, moment = model.scales.length, model.scales.moment
    # Displacements are in units of length.
    unit = np.ones(motion.unknowns)
    unit[equations.rotation_unknowns :] = 1.0 / length
    kinetic = masses.mass * length**2
    parts = {
        "mass": _scaled(motion.mass, kinetic * unit, unit),
        "damping": _scaled(motion.damping, kinetic / masses.time * unit, unit),
        "gyroscopic": _scaled(motion.gyroscopic, kinetic / masses.time * unit, unit),
        "stiffness": _scaled(motion.stiffness, moment * unit, unit),
    }
    of_rows = np.ones(equations.rows)
    of_rows[: len(model.positions.rows)] = length
    parts["constraint"] = _scaled(motion.constraints, of_rows, unit)
    return Matrices(parts, _names(motion), equations.row_names)


def _scaled(matrix: SparseMap, left: np.ndarray, right: np.ndarray) -> SparseMap:
    return SparseMap(matrix.row, matrix.column, left[matrix.row] * matrix.value * right[matrix.column], matrix.shape)


def _names(motion: SmallMotion) -> tuple[str, ...]:
    """Names of the unknowns: of rotations by node, or by member and fraction of its length."""
    model, equations = motion.model, motion.equations
    places: dict[int, str] = {}
    for name, turn in model.rotations.node_turn.items():
        if turn is not None:
            places.setdefault(turn, name)
    for name in model.members:
        for turn, at in zip(model.chain(name).tolist(), model.along(name).tolist(), strict=True):
            places.setdefault(turn, f"{name} at {at:.12g}")
    for name, ends in model.rotations.ends.items():
        for i, turn in enumerate(ends):
            places.setdefault(turn, f"{name} at end {i + 1}")
    names = [""] * equations.rotation_unknowns
    for turn, place in places.items():
        hinged = model.space and model.rotations.kind[turn] == RotationFreedom.AXIS
        for axis, number in enumerate(equations.number[turn]):
            if number >= 0:
                about = "its axis" if hinged else "xyz"[axis + 3 - equations.number.shape[1]]
                names[number] = f"{place} about {about}"
    return (*names, *model.positions.unknowns)
