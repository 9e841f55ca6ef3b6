"""Condensed matrices of small members: given as numbers or read from files of finite element programs."""

from __future__ import annotations

import io
import math
import re
import tokenize
import warnings
import zipfile
import zlib
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator

from ..errors import SceneError
from ..files import UnreadableError, read_file
from ..mathematics.arrays import first_of_largest
from .records import enumerated, say

__all__ = [
    "Mass",
    "Stiffness",
    "check_inertia",
    "check_mass",
    "check_rigid_motion",
    "check_stiffness",
    "read_matrix",
    "rigid_motions",
]

Floats = NDArray[np.float64]

EIGHT_DIGITS = 1e-7
"""Relative difference below which entries of a matrix are the same: files hold 8 digits and more."""

LARGEST = 6000
"""Rows of a matrix that are read: a thousand nodes of one small member."""

PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Ways of an archive that are unpacked piece by piece."""

MOST_BYTES = 300_000_000
"""Of a file with a matrix, and of what it unpacks to: so many rows of numbers of 8 bytes."""


def _matrix(value: Any, name: str) -> tuple[tuple[float, ...], ...]:
    if isinstance(value, (str, Path)):
        value = read_matrix(Path(value), name)
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.zeros(0)
    square = array.ndim == 2 and array.shape[0] == array.shape[1]
    if not square or not np.isfinite(array).all():
        wrong = "entries that are not finite" if square else " x ".join(map(str, array.shape)) + " numbers"
        found = wrong if isinstance(value, np.ndarray) else say(value)
        raise ValueError(f"found {found}, accepted: a square matrix of finite numbers, or a file with one")
    return tuple(tuple(row) for row in array.tolist())


Rows = tuple[tuple[float, ...], ...]

Stiffness = Annotated[Rows, BeforeValidator(lambda value: _matrix(value, "stiffness"))]
"""A square matrix: rows of numbers, an array, or the name of a file (.npz, or Matrix Market .mtx)."""

Mass = Annotated[Rows, BeforeValidator(lambda value: _matrix(value, "mass"))]
"""The mass matrix of a small member: an array, or the name of a file."""


def read_matrix(path: Path, name: str = "stiffness") -> Floats:
    """The matrix in a file: the array of that name or the only one of an .npz, .npy, or Matrix Market.

    Raises
    ------
    ValueError
        The file is absent or holds no such matrix; the sentence says which.
    """
    try:
        content = read_file(path, MOST_BYTES, "a matrix")
    except FileNotFoundError:
        raise ValueError(f"there is no file {path}") from None
    except UnreadableError as error:
        raise ValueError(f"{path}: {error}") from None
    if path.suffix.lower() not in (".npz", ".npy"):
        return _from_market(content, path)
    return _from_npz(content, path, name) if content[:4] == b"PK\3\4" else _from_npy(content, path)


def _from_npz(content: bytes, path: Path, name: str) -> Floats:
    """One array of several; of the others nothing is unpacked."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
            if name not in names and len(names) != 1:
                held = enumerated(list(names)) or "nothing"
                raise ValueError(f"the file {path} holds {held}, accepted: {name}, or one array alone")
            entry = names[name] if name in names else next(iter(names.values()))
            if entry.file_size > MOST_BYTES:
                message = f"{path}: found {entry.file_size / 1e6:.4g} MB unpacked, accepted: a matrix of"
                raise ValueError(f"{message} {MOST_BYTES / 1e6:.4g} MB at most")
            if entry.compress_type not in PACKED:
                found = f"arrays packed in the way {entry.compress_type}"
                raise ValueError(f"{path}: found {found}, accepted: not packed (0) or as numpy packs them (8)")
            with archive.open(entry) as stream:
                # What it says of its size need not be so: no more than that is unpacked.
                return _from_npy(stream.read(entry.file_size + 1), path)
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
    ) as error:
        raise ValueError(f"the file {path} cannot be read: {error}") from None


UNREAD = (
    ValueError,
    EOFError,
    SyntaxError,
    TypeError,
    OverflowError,
    MemoryError,
    RecursionError,
    tokenize.TokenError,
)
"""What numpy raises at a head that is none, which it reads as Python."""


def _from_npy(content: bytes, path: Path) -> Floats:
    """An array of real numbers; what its head announces is looked at before there is room made for it."""
    stream = io.BytesIO(content)
    try:
        major, _ = np.lib.format.read_magic(stream)
        read_head = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
        shape, _, kind = read_head(stream)
    except UNREAD:
        raise ValueError(f"the file {path} holds no arrays of numbers of numpy") from None
    if kind.hasobject:
        raise ValueError(f"the file {path} holds no arrays of numbers of numpy")
    if kind.kind not in "fiu":
        raise ValueError(f"the file {path} holds {kind.name}, accepted: real numbers")
    sizes = " x ".join(map(str, shape))[:60]
    if not all(type(size) is int and 0 < size <= LARGEST for size in shape):
        raise ValueError(f"the file {path} announces {sizes} numbers, accepted: 1 to {LARGEST} rows and columns")
    if math.prod(shape) * kind.itemsize > len(content):
        raise ValueError(f"the file {path} announces {sizes} numbers and holds fewer, accepted: all of them")
    stream.seek(0)
    try:
        return np.asarray(np.lib.format.read_array(stream, allow_pickle=False), dtype=float)
    except (ValueError, EOFError):
        raise ValueError(f"the file {path} holds no arrays of numbers of numpy") from None


COMMENT = re.compile(r"(?<![^\r\n])[ \t]*%[^\r\n]*")


def _from_market(content: bytes, path: Path) -> Floats:
    """Matrix Market exchange format, coordinate or array, general or symmetric (Boisvert et al. 1996)."""
    try:
        first, *rest = re.split(r"[\r\n]+", content.decode("utf-8-sig").strip(), maxsplit=1)
    except UnicodeDecodeError:
        raise ValueError(f"the file {path} is no text, accepted: Matrix Market, or .npz") from None
    head = first.lower().split()
    if head[:2] != ["%%matrixmarket", "matrix"] or len(head) != 5:
        raise ValueError(f"the file {path} does not begin as Matrix Market does, '%%MatrixMarket matrix'")
    kinds = ("array", "coordinate"), ("real", "double", "integer"), ("general", "symmetric")
    for found, accepted in zip(head[2:], kinds, strict=True):
        if found not in accepted:
            raise ValueError(f"the file {path} is {found}, accepted: {', '.join(accepted)}")
    text = COMMENT.sub("", rest[0]) if rest else ""
    try:
        with warnings.catch_warnings():
            # Before it was an error, numpy warned of what is no number.
            warnings.simplefilter("error", DeprecationWarning)
            # Fortran writes the exponent of double precision with a D.
            numbers = np.fromstring(text.replace("D", "e").replace("d", "e"), sep=" ")
        return _market_entries(numbers, head[2], head[4])
    except (ValueError, IndexError, DeprecationWarning):
        raise ValueError(f"the file {path} does not hold the entries that its head announces") from None


def _market_entries(numbers: Floats, layout: str, symmetry: str) -> Floats:
    n, m = _whole(numbers[:2])
    if not (0 < n <= LARGEST and 0 < m <= LARGEST):
        raise ValueError
    matrix = np.zeros((n, m))
    if layout == "array":
        column, row = np.indices((m, n)).reshape(2, -1)
        if symmetry == "symmetric":
            keep = row >= column
            row, column = row[keep], column[keep]
        matrix[row, column] = numbers[2:].reshape(len(row))
    else:
        (count,) = _whole(numbers[2:3])
        if 3 * count != len(numbers) - 3:
            raise ValueError
        entries = numbers[3:].reshape(count, 3)
        row, column = (_whole(entries[:, i]) - 1 for i in (0, 1))
        if min(row.min(initial=0), column.min(initial=0)) < 0:
            raise ValueError
        np.add.at(matrix, (row, column), entries[:, 2])
    if symmetry == "symmetric":
        matrix[column, row] = matrix[row, column]
    return matrix


def _whole(numbers: Floats) -> NDArray[np.intp]:
    """Counts and places; anything else, also what no integer holds, is a ValueError."""
    if not (np.abs(numbers) < 2.0**31).all() or (numbers % 1.0).any():
        raise ValueError
    return numbers.astype(np.intp)


def check_stiffness(matrix: ArrayLike, nodes: int) -> None:
    """Refuse a stiffness matrix that is not (6 n, 6 n) for n nodes or not symmetric; N/m, N, N m.

    Raises
    ------
    SceneError
        Place within the member.
    """
    _check_symmetric(np.asarray(matrix), nodes, "stiffness")


def check_mass(matrix: ArrayLike, nodes: int, condensed: bool) -> None:
    """Refuse a mass matrix that is not (6 n, 6 n) for n nodes, not symmetric, or without a stiffness; kg, kg m, kg m2.

    Raises
    ------
    SceneError
        Place within the member.
    """
    if not condensed:
        raise SceneError("accepted with a stiffness only: a member with a section has the mass of that", ("mass",))
    _check_symmetric(np.asarray(matrix), nodes, "mass")


def _check_symmetric(matrix: Floats, nodes: int, key: str) -> None:
    size = 6 * nodes
    if matrix.shape != (size, size):
        message = f"found {matrix.shape[0]} x {matrix.shape[1]}, accepted: {size} x {size}, 6 for each of {nodes} nodes"
        raise SceneError(message, (key,))
    gap = np.abs(matrix - matrix.T)
    if gap.max() > EIGHT_DIGITS * np.abs(matrix).max():
        i, j = np.unravel_index(first_of_largest(gap.ravel()), gap.shape)
        found = f"entry {i + 1}, {j + 1} is {matrix[i, j]:g} and entry {j + 1}, {i + 1} is {matrix[j, i]:g}"
        raise SceneError(f"is not symmetric: {found}", (key,))


def rigid_motions(rest: Floats) -> Floats:
    """The six rigid motions of nodes at ``rest`` (n, 3) as columns, (6 n, 6): along and about three axes."""
    modes = np.zeros((6 * len(rest), 6))
    for i, r in enumerate(rest):
        modes[6 * i : 6 * i + 3, :3] = np.eye(3)
        modes[6 * i : 6 * i + 3, 3:] = np.cross(np.eye(3), r).T
        modes[6 * i + 3 : 6 * i + 6, 3:] = np.eye(3)
    return modes


def check_rigid_motion(matrix: ArrayLike, rest: Floats) -> None:
    """Refuse a stiffness that resists a rigid motion of its nodes, or that gives way with a force.

    Parameters
    ----------
    matrix : (6 n, 6 n), N/m, N, N m, in the member's own axes
    rest : (n, 3), m - places of the nodes from the first one, in the same axes

    Raises
    ------
    SceneError
        Names the motion, or the shape of the negative eigenvalue; place within the member.
    """
    length = float(np.linalg.norm(rest, axis=1).max())
    unit = np.tile([1.0, 1.0, 1.0, length, length, length], len(rest))
    scaled = np.asarray(matrix) / unit[:, None] / unit[None, :]
    largest = float(np.abs(scaled).max())
    modes = rigid_motions(rest / length)
    names = [f"along {axis}" for axis in AXES] + [f"turning about {axis} at the first node" for axis in AXES]
    for name, mode in zip(names, modes.T, strict=True):
        force = np.abs(scaled @ mode).max() / np.abs(mode).max()
        if force > 1e-6 * largest:
            raise SceneError(f"resists the rigid motion {name}: {force / largest:.1e} of its largest", ("stiffness",))
    _check_definite(scaled, "stiffness")


def check_inertia(matrix: ArrayLike, rest: Floats) -> None:
    """Refuse a mass that no body has: it differs by direction, has no centre, or gives a negative energy.

    Parameters
    ----------
    matrix : (6 n, 6 n), kg, kg m, kg m2, in the member's own axes
    rest : (n, 3), m - places of the nodes from the first one, in the same axes

    Raises
    ------
    SceneError
        Names the masses, the motion, or the shape of the negative eigenvalue; place within the member.
    """
    length = float(np.linalg.norm(rest, axis=1).max())
    unit = np.tile([1.0, 1.0, 1.0, length, length, length], len(rest))
    scaled = np.asarray(matrix) / unit[:, None] / unit[None, :]
    if not scaled.any():
        return
    _check_definite(scaled, "mass")
    modes = rigid_motions(rest / length)
    block = modes.T @ scaled @ modes
    mass = float(np.trace(block[:3, :3])) / 3.0
    if mass <= 0.0 or np.abs(block[:3, :3] - mass * np.eye(3)).max() > 1e-6 * mass:
        found = ", ".join(f"{m:.7g}" for m in np.diag(block)[:3])
        coupled = float(np.abs(block[:3, :3] - np.diag(np.diag(block[:3, :3]))).max())
        found += f" kg along {', '.join(AXES)}" + (
            f", coupled by {coupled:.2g} kg" if coupled > 1e-6 * abs(mass) else ""
        )
        raise SceneError(f"found {found} in rigid motion, accepted: one mass along all", ("mass",))
    turning = block[:3, 3:]
    one_sided = np.abs(turning + turning.T)
    if one_sided.max() > 1e-6 * max(mass, float(np.abs(turning).max())):
        i, j = np.unravel_index(first_of_largest(one_sided.ravel()), (3, 3))
        message = f"has no centre of mass: turning about {AXES[j]} has momentum along {AXES[i]} that no centre gives"
        raise SceneError(message, ("mass",))


def _check_definite(scaled: Floats, key: str) -> None:
    """Refuse a matrix, rotations times a length, with a negative eigenvalue."""
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    if values[0] < -EIGHT_DIGITS * float(np.abs(scaled).max()):
        shape = ", ".join(f"{v + 0.0:.2g}" for v in vectors[:, 0])
        raise SceneError(f"is indefinite: eigenvalue {values[0]:.3g} of the shape [{shape}]", (key,))


AXES = ("b1", "b2", "b3")
