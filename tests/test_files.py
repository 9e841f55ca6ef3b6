"""Files that are read: plain ones of a bounded size only, whatever a scene or a command line names."""

import contextlib
import io
import os
import re
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest

from sfetcas import SceneError, load
from sfetcas.cli import main
from sfetcas.description.matrices import _from_market, _from_npz, _matrix, read_matrix
from sfetcas.files import write_file
from sfetcas.sweeps.cases import read_cases


def pipe(path):
    os.mkfifo(path)
    # Whoever waits for it gets something.
    os.open(path, os.O_RDWR)


def header(shape, kind="<f8"):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": kind, "fortran_order": False, "shape": shape})
    return stream.getvalue()


def bomb(path):
    """Little that unpacks to more than a matrix may have."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("stiffness.npy", "w") as entry:
        entry.write(header((6400, 6400)))
        for _ in range(330):
            entry.write(bytes(1_000_000))


def sparse(path):
    """A file with a size and nothing in it."""
    with path.open("wb") as file:
        file.truncate(10**13)


KINDS = {
    "a folder": os.mkdir,
    "a pipe": pipe,
    "a device": lambda path: os.symlink("/dev/zero", path),
    "1e+07 MB": sparse,
}
READERS = {
    "scene.toml": load,
    "cases.csv": read_cases,
    "k.npz": read_matrix,
    "k.npy": read_matrix,
    "k.mtx": read_matrix,
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", READERS)
def test_only_plain_files_are_read(name, kind, tmp_path, monkeypatch):
    path = tmp_path / name
    KINDS[kind](path)
    monkeypatch.setattr(os, "open", lambda *a, **k: pytest.fail("opened")) if kind != "1e+07 MB" else None
    with pytest.raises(ValueError, match=f"{re.escape(kind)}, accepted: a"):
        READERS[name](path)


def test_links_and_made_up_files_are_read(tmp_path):
    np.save(tmp_path / "k.npy", np.eye(6))
    os.symlink(tmp_path / "k.npy", tmp_path / "link.npy")
    assert (read_matrix(tmp_path / "link.npy") == np.eye(6)).all()
    # Of a size that is not told before, as the system makes it up.
    if os.path.exists("/proc/self/status"):
        with pytest.raises(ValueError, match="does not begin as Matrix Market does"):
            read_matrix(type(tmp_path)("/proc/self/status"))


def bzipped(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("stiffness.npy", header((6, 6)) + bytes(1000))


def headed(text):
    """An array with another head."""
    return lambda path: path.write_bytes(b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode() + bytes(288))


PICKLED = io.BytesIO()
np.save(PICKLED, np.array([print], dtype=object), allow_pickle=True)
ARCHIVES = {
    "more than it holds": (lambda p: p.write_bytes(header((10**6, 10**6)) + bytes(64)), "announces 1000000 x 1000000"),
    "a bomb": (bomb, r"330 MB unpacked, accepted: a matrix of 300 MB"),
    "objects": (lambda p: p.write_bytes(PICKLED.getvalue()), "holds no arrays of numbers"),
    "packed otherwise": (bzipped, r"in the way 12, accepted: not packed \(0\) or as numpy packs them \(8\)"),
    "a head without an end": (headed("(" * 90 + "\n"), "holds no arrays of numbers"),
    "a head of another kind": (headed("{{}: 1}\n"), "holds no arrays of numbers"),
    "a head of parentheses": (headed("-" * 9000 + "1\n"), "holds no arrays of numbers"),
    "sizes below nothing": (lambda p: p.write_bytes(header((-6, -6)) + bytes(288)), "announces -6 x -6 numbers, accep"),
    "sizes of no end": (lambda p: p.write_bytes(header((10**300, 0))), "0 numbers, accepted: 1 to 6000 rows"),
    "sizes that are true": (lambda p: p.write_bytes(header((True, True)) + bytes(8)), "announces True x True numbers"),
    "half": (lambda p: p.write_bytes(b"PK\3\4 and nothing else"), "cannot be read"),
}


@pytest.mark.parametrize("kind", ARCHIVES)
def test_what_unpacks_to_more_than_it_may_is_refused(kind, tmp_path):
    write, sentence = ARCHIVES[kind]
    write(tmp_path / "k.npz")
    with pytest.raises(ValueError, match=sentence):
        read_matrix(tmp_path / "k.npz")


def test_numbers_that_no_float_holds_are_no_matrix():
    with pytest.raises(ValueError, match=r"^found \[\[1000.*\.\.\., accepted: a square matrix of finite numbers"):
        _matrix([[10**400]], "stiffness")


def test_no_more_is_unpacked_than_an_archive_says(tmp_path):
    content = header((6, 6)) + bytes(20_000_000)
    with zipfile.ZipFile(tmp_path / "k.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("stiffness.npy", content)
    said, lie = (struct.pack("<I", size) for size in (len(content), 416))
    archive = (tmp_path / "k.npz").read_bytes().replace(said, lie)
    assert peak_of(_from_npz, archive, tmp_path, "stiffness") < 1_000_000


def test_numbers_of_a_text_are_read_without_a_text_for_each(tmp_path):
    text = b"%%MatrixMarket matrix array real general\n300 300\n" + 90_000 * b"10\n"
    assert peak_of(_from_market, text, tmp_path) < 20 * len(text)


def peak_of(work, *given):
    """Most bytes that some work has at once, whether it is refused or not."""
    tracemalloc.start()
    try:
        with contextlib.suppress(ValueError):
            work(*given)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_any_name_that_a_folder_takes_is_written(tmp_path):
    path = tmp_path / f"a.{'b' * 250}"
    write_file(path, lambda there: there.write_text("all"))
    assert path.read_text() == "all"
    assert list(tmp_path.iterdir()) == [path]


def test_a_scene_that_names_a_device_is_one_sentence(tmp_path, capsys):
    member = '[members.m]\ntype = "small"\nnodes = ["a", "b"]\nstiffness = "/dev/zero"\n'
    (tmp_path / "scene.toml").write_text(f"[nodes.a]\nposition = [0, 0]\n[nodes.b]\nposition = [1, 0]\n{member}")
    assert main(["run", str(tmp_path / "scene.toml")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "/dev/zero: this is a device, accepted: a matrix" in told
    with pytest.raises(SceneError, match="this is a device, accepted: a scene file"):
        load(os.symlink("/dev/zero", tmp_path / "z.json") or tmp_path / "z.json")
