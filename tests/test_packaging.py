"""What is installed: the package, its marker for type checkers and its command, not the benchmarks and the tests."""

import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

import sfetcas
from sfetcas.cli import main
from sfetcas.core import building

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The wheel and the source distribution."""
    wheels = pytest.importorskip("hatchling.builders.wheel")
    sources = pytest.importorskip("hatchling.builders.sdist")
    folder = str(tmp_path_factory.mktemp("dist"))
    (wheel,) = wheels.WheelBuilder(str(ROOT)).build(directory=folder)
    (source,) = sources.SdistBuilder(str(ROOT)).build(directory=folder)
    return Path(wheel), Path(source)


def test_wheel_holds_the_package_alone(built):
    with zipfile.ZipFile(built[0]) as archive:
        names = archive.namelist()
        (commands,) = (archive.read(name).decode() for name in names if name.endswith("entry_points.txt"))
    assert {name.split("/")[0] for name in names} == {"sfetcas", f"sfetcas-{sfetcas.__version__}.dist-info"}
    assert {"sfetcas/py.typed", "sfetcas/mechanics/model.py"} <= set(names)
    assert not [name for name in names if "benchmark" in name]
    assert "sfetcas = sfetcas.cli:main" in commands


def test_wheel_is_one_of_a_platform_where_there_is_a_compiler(built):
    with zipfile.ZipFile(built[0]) as archive:
        libraries = [name for name in archive.namelist() if name.endswith(building.SUFFIX)]
    if building.compiler() is None:
        assert built[0].name.endswith("-py3-none-any.whl")
        assert not libraries
    else:
        assert not built[0].name.endswith("-any.whl")
        (library,) = libraries
        assert library.startswith(f"sfetcas/core/{building.prefix()}")


def test_wheel_without_the_core_is_for_every_machine(tmp_path, monkeypatch):
    wheels = pytest.importorskip("hatchling.builders.wheel")
    monkeypatch.setenv("SFETCAS_CORE", "off")
    (wheel,) = wheels.WheelBuilder(str(ROOT)).build(directory=str(tmp_path))
    assert wheel.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        assert not [name for name in archive.namelist() if name.endswith(building.SUFFIX)]


def test_source_distribution_holds_what_tests_and_documentation_need(built):
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    needed = {
        ".ci/hatch_build.py",
        "LICENSE",
        "README.md",
        "CITATION.cff",
        "docs/conf.py",
        "tests/test_packaging.py",
        "pyproject.toml",
    }
    assert needed | {"problems/lee_frame.toml", "benchmarks/scenes.py"} <= names
    # What is made from the program is made anew.
    assert not {name for name in names if name.startswith(("docs/gallery", "docs/reference/api"))}


def test_an_index_would_take_both(built):
    pytest.importorskip("twine")
    done = subprocess.run(
        [sys.executable, "-m", "twine", "check", "--strict", *built], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("PASSED") == 2


def test_installed_wheel_solves_a_scene(built, tmp_path):
    """Beside the libraries of this environment, away from the sources."""
    venv.create(tmp_path / "env", with_pip=False)
    scheme = sysconfig.get_preferred_scheme("prefix")
    paths = {name: sysconfig.get_path(name, scheme, {"base": str(tmp_path / "env")}) for name in ("purelib", "scripts")}
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target", paths["purelib"]]
    subprocess.run([*pip, built[0]], check=True)
    python = Path(paths["scripts"]) / ("python.exe" if sys.platform == "win32" else "python")
    # Appended, so that what was installed here comes first.
    libraries = (
        f"import sys; sys.path.append({sysconfig.get_path('purelib')!r}); import sfetcas; print(sfetcas.__file__);"
    )
    run = "from sfetcas.cli import main; sys.exit(main(['run', 'lee_frame.toml', '--plot', 'lee.png']))"
    (tmp_path / "lee_frame.toml").write_bytes((ROOT / "problems" / "lee_frame.toml").read_bytes())
    done = subprocess.run(
        [python, "-I", "-c", libraries + run], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(paths["purelib"])
    assert "limit point" in done.stdout
    assert (tmp_path / "lee.png").stat().st_size > 10_000


def test_command_tells_its_version(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"sfetcas {sfetcas.__version__}\n"


def test_citation_is_of_this_version():
    assert f"\nversion: {sfetcas.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
