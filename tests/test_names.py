"""Names and titles that try to be more than data: everything that is made of a scene is made of such, built and run."""

import csv
import json
import re
import subprocess
import sys
import zipfile
from xml.etree import ElementTree

import pytest
from test_codegen import needs_compiler, said

from sfetcas import Scene, SceneError, dump, export
from sfetcas.cli import main
from sfetcas.quoting import csv_cell

RUN = 'system("touch CANARY");'
ATTRIBUTE = "__attribute__((constructor)) static void"
NAMES = [
    f"x */ int system(); {ATTRIBUTE} a(void){{{RUN}}} /* ",
    'x"""; getattr(__import__("os"),"system")("touch CANARY"); """',
    f'x??/",0,1,0}},{{0,0,0,0}}}}; {ATTRIBUTE} b(void){{{RUN}}} static const entry zz[]={{{{0,0,0,0}},//',
    f'x",0,1,0}},{{0,0,0,0}}}}; {ATTRIBUTE} c(void){{{RUN}}} static const entry zz[]={{{{0,0,0,0}},//',
    "$(shell touch CANARY) $(touch CANARY) `touch CANARY` ${CANARY} ; touch CANARY #",
    "x'; touch CANARY; getattr(__import__('os'),'system')('touch CANARY'); '",
    "]]> --> <img src=x onerror=alert(1)> | cell | [a](javascript:b) &amp; ```",
    "=cmd|'/C touch CANARY'!A1",
    "@title@ @name@",
    "😀é ü \\",
    "\\u0022 \\N{DIGIT ONE} \\x22 \\101 ends in \\",
    "%s%n%d {0} {name} $\\frac{ $x$",
    "for",
    "tip-load",
    "tip load",
    "a=b",
    "??/ ??' *??/ ??",
    "/",
    "/up/",
    "_hidden",
    "long" * 80,
]
TITLE = '\x1b]0;owned\x07 *??/\n/ """ \\" ' + " ".join(NAMES) + "\r\n\x9b2J \u202e \ufffe \\"


def hostile(**more):
    """A cantilever all of whose names are hostile, with a load of each name."""
    root, tip, member, section = NAMES[1], NAMES[4], NAMES[0], NAMES[9]
    table = {
        "title": TITLE,
        "sections": {section: {"EI3": 1.0, "rhoA": 1.0}},
        "nodes": {root: {"position": [0, 0], "support": "clamped"}, tip: {"position": [1, 0]}},
        "members": {member: {"nodes": [root, tip], "section": section, "element": "SFET3", "elements": 2}},
        "loads": {name: {"type": "force", "node": tip, "value": [0, 0.01 + 0.001 * i]} for i, name in enumerate(NAMES)},
    }
    return Scene.from_dict({**table, **more})


MOVING = {
    "histories": {name: {"t": [0, 1], "value": [1, 1]} for name in NAMES},
    "analysis": {"type": "dynamic", "end": 0.2, "step": 0.01},
}
KINDS = {
    "solver": ({}, {}),
    "program": ({}, {"derivatives": True}),
    "motion": (MOVING, {}),
}


def python(text, folder):
    run = subprocess.run([sys.executable, "-W", "error", "-c", text], cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout


@needs_compiler
@pytest.mark.parametrize("kind", KINDS)
def test_exports_have_names_as_data(kind, tmp_path, monkeypatch):
    more, options = KINDS[kind]
    folder = tmp_path / "c"
    made = export(hostile(**more), folder, name="made", **options)
    names = [one.name for one in made.arguments.arguments]
    assert {f"loads.{name}.value" for name in NAMES} <= set(names)
    monkeypatch.chdir(folder)
    # As the Makefile asks for it, and as the standard reads it, where ??/ is a backslash.
    cc = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-O0"]
    strict = [*cc, "-trigraphs", "-pedantic", "-Wno-overlength-strings"]
    subprocess.run([*strict, "-fPIC", "-shared", "-o", "libmade.so", "made.c", "-lm"], check=True)
    for flags in (cc, strict):
        subprocess.run([*flags, "-o", "example", "main.c", "./libmade.so", "-lm"], check=True)
    subprocess.run([*strict, "-o", "check", "check.c", "./libmade.so", "-lm"], check=True)
    example = folder / "example"
    assert "agree" in said(folder / "check")
    listed = subprocess.run([str(example), "?"], capture_output=True, check=False)
    # Names come out of C as they went in.
    text = listed.stderr.decode()
    for name in names:
        assert f"  {name} [" in text
    words = ["2", "0.01"] if kind == "motion" else []
    said(example, *words, *(f"loads.{name}.value.1=0.02" for name in NAMES))
    manifest = json.loads((folder / "manifest.json").read_text())
    assert [one["name"] for one in manifest["arguments"]] == names
    readme = (folder / "README.md").read_text()
    assert not re.search(r"(?<!\\)[<|]\s*img|\n\S*owned\n", readme)
    # Cells stay cells, and what stands as code to be copied is one word.
    for line in readme.splitlines():
        if line.startswith("| "):
            assert len(re.findall(r"(?<!\\)\|", line)) in (3, 5, 6)
    if kind == "program":
        (command,) = re.findall(r"^\./main .*", readme, re.MULTILINE)
        subprocess.run(["sh", "-c", command.replace("./main", "true")], cwd=folder, check=True)
    else:
        ask = "Solver().solve" if kind == "solver" else "Motion().step"
        first = "0.01, " if kind == "motion" else ""
        told = python(
            f"import json, made\nm = made.__doc__\nd = {{f'loads.{{n}}.value': [0, 0.02] for n in {NAMES!r}}}\n"
            f"a = made.{ask}({first}d)\nprint(json.dumps([m, a]))",
            folder,
        )
        words, answer = json.loads(told)
        assert words.startswith(TITLE.strip()[:300])
        assert answer["status"] == 0
        assert answer[f"nodes.{NAMES[4]}.position"][1] > 0.0
    if kind == "motion":
        unit = [
            sys.executable,
            "-m",
            "pythonfmu",
            "build",
            "-f",
            "made_unit.py",
            "made.py",
            "manifest.json",
            "libmade.so",
        ]
        subprocess.run(unit, cwd=folder, check=True, capture_output=True)
        with zipfile.ZipFile(folder / "MadeUnit.fmu") as archive:
            variables = ElementTree.fromstring(archive.read("modelDescription.xml")).iter("ScalarVariable")
        assert {f"loads.{name}.value.1" for name in NAMES} <= {one.get("name") for one in variables}
    assert not list(tmp_path.rglob("*CANARY*"))


@pytest.mark.parametrize("kind", ["static", "path", "dynamic"])
def test_answers_have_names_as_data(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    analysis = {"static": {"type": "static"}, "path": {"type": "path", "range": [0, 1]}, "dynamic": MOVING["analysis"]}[
        kind
    ]
    scene = hostile(analysis=analysis)
    dump(scene, "scene.json")
    outs = ["--json", "out.json", "--plot", "out.svg", "--vtk", "vtk"]
    assert main(["run", "scene.json", *outs]) == 0
    printed = capsys.readouterr()
    for stream in printed:
        assert all(line.isprintable() for line in stream.split("\n"))
    assert NAMES[1] in printed.out
    answer = json.loads((tmp_path / "out.json").read_text())
    assert answer["title"] == TITLE
    assert all(json.dumps(name) in (tmp_path / "out.json").read_text() for name in scene.nodes)
    for file in ["out.svg", *sorted(path for path in (tmp_path / "vtk").iterdir() if path.suffix == ".pvd")]:
        ElementTree.parse(file)
    assert not list(tmp_path.rglob("*CANARY*"))


def test_tables_have_names_as_data(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    dump(hostile(), "scene.json")
    column = f"loads.{NAMES[7]}.value.1"
    asked = ["--vary", f"{column}=0.01,1e300", "--quantity", f"nodes.{NAMES[4]}.position", "--workers", "1"]
    outs = [word for ending in ("csv", "json", "npz") for word in ("--out", f"out.{ending}")]
    assert main(["sweep", "scene.json", *asked, *outs]) == 1
    assert all(line.isprintable() for line in capsys.readouterr().out.split("\n"))
    with open("out.csv", newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head[0] == column
    assert json.loads((tmp_path / "out.json").read_text())["columns"][column][0] == 0.01
    assert not any(cell.lstrip()[:1] in tuple("=+@") for row in (head, *rows) for cell in row)
    # What begins as a formula is a text; numbers stay numbers.
    assert [csv_cell(cell) for cell in (NAMES[7], "-1+1", "\t@x", -1.5)] == ["'" + NAMES[7], "'-1+1", "'\t@x", -1.5]
    assert not list(tmp_path.rglob("*CANARY*"))


@pytest.mark.parametrize("name", ["../up", "a b", "for", "ctypes", "stdio", "SF", "", "é", "x\n", "a" * 61])
def test_names_of_files_are_identifiers(name, tmp_path):
    with pytest.raises(SceneError, match="accepted: a name of letters, digits and _"):
        export(hostile(), tmp_path / "c", name=name)
    assert not list(tmp_path.iterdir())


def test_sentences_steer_no_terminal(tmp_path, capsys):
    file = tmp_path / "a\x1b[31m.toml"
    file.write_text('[nodes."\\u001b[2J\\u009b1m"]\nposition = ["\\u001b]0;owned\\u0007", 1]\n')
    assert main(["run", str(file)]) == 2
    said_of_it = capsys.readouterr().err
    assert said_of_it.endswith("\n")
    assert said_of_it[:-1].isprintable()
