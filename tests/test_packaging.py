"""What is installed: the package, its marker for type checkers and its command, not the benchmarks and the tests."""

import zipfile
from pathlib import Path

import pytest

import sfetcas
from sfetcas.cli import main


def test_wheel_holds_the_package_alone(tmp_path):
    wheels = pytest.importorskip("hatchling.builders.wheel")
    (wheel,) = wheels.WheelBuilder(str(Path(__file__).parent.parent)).build(directory=str(tmp_path))
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (commands,) = (archive.read(name).decode() for name in names if name.endswith("entry_points.txt"))
    assert {name.split("/")[0] for name in names} == {"sfetcas", f"sfetcas-{sfetcas.__version__}.dist-info"}
    assert {"sfetcas/py.typed", "sfetcas/mechanics/model.py"} <= set(names)
    assert not [name for name in names if "benchmark" in name]
    assert "sfetcas = sfetcas.cli:main" in commands


def test_command_tells_its_version(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"sfetcas {sfetcas.__version__}\n"
