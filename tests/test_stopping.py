"""SIGTERM and Ctrl-C: a sentence, the usual exit code, and nothing left behind, whenever they come."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from sfetcas import cli, processes, stopping
from sfetcas.core.building import named

PROBLEMS = Path(__file__).parent.parent / "problems"
SIGNALS = {signal.SIGTERM: 143, signal.SIGINT: 130}

pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs the signals of POSIX")


def started(folder, *words, before=""):
    """The command line as a process that says when it is where ``before`` puts a word on its standard error."""
    # Sockets of processes stand there, whose paths may have hardly more than a hundred characters.
    short = tempfile.mkdtemp(dir=folder.parent)
    (folder / "tmp").symlink_to(short)
    environment = {**os.environ, "TMPDIR": short, "SFETCAS_CACHE": str(folder / "cache")}
    code = f"import sys, os, signal\nsys.argv = ['sfetcas', *{words!r}]\nsay = lambda: os.write(2, b'here\\n')\n"
    code += f"signal.signal(signal.SIGINT, signal.default_int_handler)\n{before}\n"
    code += "from sfetcas.cli import main\nsys.exit(main())"
    return subprocess.Popen(
        [sys.executable, "-c", code], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def ended(process, *numbers):
    """Exit code and what was said, after signals at the word; on a slow machine it tells how far it is meanwhile."""
    with process:
        assert b"here\n" in iter(process.stderr.readline, b"")
        for number in numbers:
            process.send_signal(number)
        _, error = process.communicate(timeout=60)
    said = error.decode().splitlines(keepends=True)
    return process.returncode, "".join(line for line in said if not line.endswith("so far\n"))


WHILE_IMPORTING = """
import importlib.abc
class Say(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == "casadi":
            say()
            import time
            time.sleep(60)
sys.meta_path.insert(0, Say())
"""


@pytest.mark.parametrize("number", SIGNALS)
def test_while_it_imports(number, tmp_path):
    process = started(tmp_path, "run", str(PROBLEMS / "bend_45_degrees.toml"), before=WHILE_IMPORTING)
    assert ended(process, number, number) == (SIGNALS[number], f"{stopping.SENTENCE}\n")


WHILE_COMPILING = """
from sfetcas.mathematics import kernels
import subprocess, time
def slow(command, **options):
    open(command[command.index("-o") + 1], "wb").write(b"half")
    say()
    time.sleep(60)
kernels.subprocess.run = slow
os.environ["SFETCAS_KERNELS"] = "compiled"
"""
WHILE_WRITING = """
from sfetcas import outputs
import time
def slow(answer, path):
    path.write_text("half")
    say()
    time.sleep(60)
outputs._json = lambda path, scene: slow
"""


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("before", [WHILE_COMPILING, WHILE_WRITING], ids=["compiling", "writing"])
def test_nothing_is_left(number, before, tmp_path):
    # Whoever ends a group of processes sends it twice to some: the second one disturbs nothing.
    twice = [number] * (2 if number == signal.SIGTERM else 1)
    process = started(tmp_path, "run", str(PROBLEMS / "bend_45_degrees.toml"), "--json", "out.json", before=before)
    assert ended(process, *twice) == (SIGNALS[number], f"{stopping.SENTENCE}\n")
    left = [path for path in tmp_path.rglob("*") if path.is_file()]
    # Tapes that were put into the cache before are whole.
    assert all(path.name == named(path.name[: len("tape-") + 25], path.read_bytes(), ".npz") for path in left)
    assert {path.parent.name for path in left} <= {"cache"}


def test_a_sweep_ends_with_all_its_processes(tmp_path):
    before = "from sfetcas.sweeps import feeding\ntake = feeding._Feeding._take\n"
    before += "def told(self, future):\n    take(self, future)\n    say()\nfeeding._Feeding._take = told\n"
    words = ["sweep", str(PROBLEMS / "bend_45_degrees.toml"), "--vary", "factor=0.1:1:4000", "--workers", "2"]
    process = started(tmp_path, *words, "--out", "out.csv", before=before)
    # Its pipes are closed when the last of them has ended.
    code, error = ended(process, signal.SIGTERM)
    assert code == 143
    assert error.replace("here\n", "") == "sfetcas: interrupted: what was solved before is kept\n"
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 4001
    assert not list((tmp_path / "tmp").iterdir())


SWALLOWING = """
from sfetcas import cli
import time
def swallowing(*_, **__):
    try:
        say()
        time.sleep(60)
    except KeyboardInterrupt:
        pass
    try:
        time.sleep(3)
    finally:
        time.sleep(0.5)
        os.write(2, b"in order\\n")
cli.solve = swallowing
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs a timer")
@pytest.mark.parametrize("number", SIGNALS)
def test_what_a_library_swallows_is_raised_again_until_it_arrives(number, tmp_path):
    # Meanwhile what puts things in order is not disturbed.
    process = started(tmp_path, "run", str(PROBLEMS / "bend_45_degrees.toml"), before=SWALLOWING)
    assert ended(process, number) == (SIGNALS[number], f"in order\n{stopping.SENTENCE}\n")


def test_signals_that_other_threads_take_wait_while_processes_start():
    seen = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: seen.append(number))
    over = threading.Event()
    other = threading.Thread(target=over.wait)
    other.start()
    try:
        with processes.postponed():
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.05)
            assert seen == []
        assert seen == [signal.SIGTERM]
    finally:
        over.set()
        other.join()
        signal.signal(signal.SIGTERM, before)


def test_after_all_was_written_a_signal_adds_nothing(tmp_path):
    # The name of what runs is another one then, where it is ``python -m sfetcas``.
    before = "import atexit, sfetcas\nsay()\nsys.argv[0] = '__main__.py'\n"
    before += "atexit.register(os.kill, os.getpid(), signal.SIGTERM)"
    process = started(tmp_path, "info", str(PROBLEMS / "bend_45_degrees.toml"), before=before)
    assert ended(process) == (0, "")


def test_within_another_program_signals_are_left_alone():
    before = [signal.getsignal(number) for number in SIGNALS]
    code = "import signal, sfetcas; print(signal.getsignal(signal.SIGTERM) == signal.SIG_DFL)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "True\n"
    assert cli.main(["info", str(PROBLEMS / "bend_45_degrees.toml")]) == 0
    assert [signal.getsignal(number) for number in SIGNALS] == before
    # Only the main thread may have a say in them.
    codes = []
    thread = threading.Thread(target=lambda: codes.append(cli.main(["info", "absent.toml"])))
    thread.start()
    thread.join()
    assert codes == [2]
