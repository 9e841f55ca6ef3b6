"""Files that are read: plain ones of a bounded size only, whatever a scene or a command line names."""

import io
import os
import re
import zipfile

import numpy as np
import pytest

from sfetcas import SceneError, load
from sfetcas.cli import main
from sfetcas.description.matrices import read_matrix
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


PICKLED = io.BytesIO()
np.save(PICKLED, np.array([print], dtype=object), allow_pickle=True)
ARCHIVES = {
    "more than it holds": (lambda p: p.write_bytes(header((10**6, 10**6)) + bytes(64)), "announces 1000000 x 1000000"),
    "a bomb": (bomb, r"330 MB unpacked, accepted: a matrix of 300 MB"),
    "objects": (lambda p: p.write_bytes(PICKLED.getvalue()), "holds no arrays of numbers"),
    "half": (lambda p: p.write_bytes(b"PK\3\4 and nothing else"), "cannot be read"),
}


@pytest.mark.parametrize("kind", ARCHIVES)
def test_what_unpacks_to_more_than_it_may_is_refused(kind, tmp_path):
    write, sentence = ARCHIVES[kind]
    write(tmp_path / "k.npz")
    with pytest.raises(ValueError, match=sentence):
        read_matrix(tmp_path / "k.npz")


def test_a_scene_that_names_a_device_is_one_sentence(tmp_path, capsys):
    member = '[members.m]\ntype = "small"\nnodes = ["a", "b"]\nstiffness = "/dev/zero"\n'
    (tmp_path / "scene.toml").write_text(f"[nodes.a]\nposition = [0, 0]\n[nodes.b]\nposition = [1, 0]\n{member}")
    assert main(["run", str(tmp_path / "scene.toml")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "/dev/zero: this is a device, accepted: a matrix" in told
    with pytest.raises(SceneError, match="this is a device, accepted: a scene file"):
        load(os.symlink("/dev/zero", tmp_path / "z.json") or tmp_path / "z.json")
