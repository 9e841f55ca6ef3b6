"""Scene files: what is read, what is written, and the sentence where that fails."""

import json
import os
import re

import pytest

from sfetcas.description import scenefile
from sfetcas.description.scene import Analysis, Expect, History, Load, Member, Motion, Node, Scene
from sfetcas.description.scenefile import _table, dump, load, parse
from sfetcas.description.sections import CrossSection
from sfetcas.errors import SceneError

EXAMPLE = """
title = "strip with a force at its tip"
source = "free text"
dimension = "auto"
gravity = [0, -9.81, 0]

[sections.strip]
EI2 = 1.0
EI3 = 1.0
GJ = 1.0
rhoA = 1.0
rhoI = [0.02, 0.01, 0.01]
[sections.waisted]
EI3 = {at = [0, 0.5, 1], value = [1, 2, 1]}
rhoA = {polynomial = [1, -0.5]}
[sections.bar]
shape = "rectangle"
width = 0.02
height = 0.01
E = 2.1e11
nu = 0.3
rho = 7850

[nodes.A]
position = [0, 0, 0]
support = "clamped"
[nodes.B]
position = [1, 0, 0]
joint = "rigid"
start = [0.9, 0.3, 0]
[nodes.C]
position = [2, 0]
support = "slider"
direction = [1, 0]
rotation = "hinge"

[members.beam]
nodes = ["A", "B"]
type = "flexible"
section = "strip"
shape = {type = "straight"}
b2 = [0, 1, 0]
element = "SFET3"
elements = 8
release = ["rigid", "hinge"]
[members.bow]
nodes = ["B", "C"]
section = "waisted"
shape = {type = "arc", angle = 1.57, normal = [0, 0, 1]}

[loads.tip]
type = "force"
node = "B"
value = [0, 1, 0]
frame = "fixed"
history = "ramp"
[loads.wind]
type = "distributed"
member = "beam"
value = [0, 1]
profile = {polynomial = [1, -1]}
[loads.twist]
type = "moment"
member = "bow"
at = 0.5
value = 0.25

[histories.ramp]
t = [0, 1, 2]
value = [0, 1, 0]

[motions.crank]
node = "A"
rotation = 0.5
history = "ramp"

[analysis]
type = "static"
accuracy = 1e-6
steps = [0.5, 1, 2, 3]
unstable = "leave"
equilibria = "one"

[[expect]]
quantity = "nodes.B.position"
value = [0.9436, 0.3017]
tolerance = 1e-4
why = "printed with 4 digits"
source = "..."
step = 1.0
[[expect]]
quantity = "members.beam.moment"
at = 0.0
value = [0, 0, 0.9436]
tolerance = 1e-4
"""

SPOKEN = Scene(
    title="strip with a force at its tip",
    source="free text",
    gravity=[0, -9.81],
    sections={
        "strip": CrossSection(EI2=1, EI3=1, GJ=1, rhoA=1, rhoI=[0.02, 0.01, 0.01]),
        "waisted": CrossSection(EI3={"at": [0, 0.5, 1], "value": [1, 2, 1]}, rhoA={"polynomial": [1, -0.5]}),
        "bar": CrossSection(shape="rectangle", width=0.02, height=0.01, E=2.1e11, nu=0.3, rho=7850),
    },
    nodes={
        "A": Node(position=[0, 0], support="clamped"),
        "B": Node(position=[1, 0], start=[0.9, 0.3]),
        "C": Node(position=[2, 0], support="slider", direction=[1, 0], rotation="hinge"),
    },
    members={
        "beam": Member(
            nodes=["A", "B"],
            section="strip",
            b2=[0, 1],
            element="SFET3",
            elements=8,
            release=["rigid", "hinge"],
        ),
        "bow": Member(nodes=["B", "C"], section="waisted", shape={"type": "arc", "angle": 1.57, "normal": [0, 0, 1]}),
    },
    loads={
        "tip": Load(type="force", node="B", value=[0, 1], history="ramp"),
        "wind": Load(type="distributed", member="beam", value=[0, 1], profile={"polynomial": [1, -1]}),
        "twist": Load(type="moment", member="bow", at=0.5, value=0.25),
    },
    motions={"crank": Motion(node="A", rotation=0.5, history="ramp")},
    histories={"ramp": History(t=[0, 1, 2], value=[0, 1, 0])},
    analysis=Analysis(accuracy=1e-6, steps=[0.5, 1, 2, 3]),
    expect=[
        Expect(
            quantity="nodes.B.position",
            value=[0.9436, 0.3017],
            tolerance=1e-4,
            why="printed with 4 digits",
            source="...",
            step=1.0,
        ),
        Expect(quantity="members.beam.moment", at=0, value=[0, 0, 0.9436], tolerance=1e-4),
    ],
)


def test_the_file_says_the_same_as_python():
    assert parse(EXAMPLE, "toml") == SPOKEN


@pytest.mark.parametrize("ending", [".toml", ".json", ".TOML", ".Json"])
def test_round_trip_through_a_file(tmp_path, ending):
    path = tmp_path / f"scene{ending}"
    dump(SPOKEN, path)
    assert load(path) == SPOKEN
    assert load(str(path)) == SPOKEN
    assert os.listdir(tmp_path) == [path.name]


def test_json_has_the_same_keys():
    assert parse(json.dumps(SPOKEN.to_dict()), "json") == SPOKEN


def test_a_byte_order_mark_and_windows_lines_are_read(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + EXAMPLE.replace("\n", "\r\n").encode())
    assert load(path) == SPOKEN


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("scene.yaml", b"", "found the ending '.yaml', accepted: .toml, .json"),
        ("scene", b"", "found the ending '', accepted: .toml, .json"),
        ("scene.toml", b"", "the file is empty, accepted: a scene with sections, nodes and members"),
        ("scene.json", b" \n", "the file is empty, accepted: a scene with sections, nodes and members"),
        ("scene.toml", b"title = '\xff'", "found a byte that is not UTF-8 at position 9, accepted: UTF-8"),
        ("scene.toml", b"# one\ntitle = ", "not read as TOML: Invalid value (at "),
        ("scene.toml", b"title = 'a'\ntitle = 'b'", "not read as TOML: Cannot overwrite a value (at "),
        ("scene.json", b'{"title": }', "not read as JSON: Expecting value: line 1 column 11"),
        ("scene.json", b'{"nodes": {"A": {}, "A": {}}}', "not read as JSON: the key 'A' stands twice in one"),
        ("scene.toml", b"a." * 20 + b"b = 1", "not read as TOML: found the key 'a.a."),
        ("scene.toml", b"[ a" + b' . "b \'c"' * 20 + b"]", "not read as TOML: found the key 'a . x . "),
        (
            "scene.toml",
            b"gravity = " + b"9" * 5000,
            "not read as TOML: found a whole number with over 4300 digits, acc",
        ),
        ("scene.json", b'{"title": ' + b"9" * 5000 + b"}", "not read as JSON: found a whole number with over 4300"),
        (
            "scene.toml",
            b"title = 0x" + b"f" * 5000,
            "title: found a whole number with over 4300 digits, accepted: a te",
        ),
        ("scene.json", b"[" * 100000, "not read as JSON: lists or tables are nested too deeply"),
        ("scene.json", b"[]", "found [], accepted: a table"),
        ("scene.json", b"{}", "scene without members: "),
        ("scene.json", b'{"gravity": [0, NaN]}', "gravity: found nan, accepted: a finite number"),
        ("scene.toml", b"title = 1979-05-27", "title: found datetime.date(1979, 5, 27), accepted: a text"),
        ("scene.toml", b"gravity = [0, 07:32:00]", "gravity: found datetime.time(7, 32), accepted: a number"),
    ],
)
def test_files_that_are_refused(tmp_path, name, content, sentence):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(SceneError, match="^" + re.escape(f"{path}: {sentence}")) as caught:
        load(path)
    assert "\n" not in str(caught.value)


DOTS = "a." * 30 + "a"


@pytest.mark.parametrize(
    "title",
    [
        f'"{DOTS}"',
        f"'{DOTS}'",
        f'"it\\"s {DOTS}"',
        f'"""\n{DOTS} "" \\""" {DOTS}"""""',
        f"'''\n{DOTS} '' {DOTS}'''",
        f'"a" # it\'s {DOTS}\n# """ {DOTS}',
        f'"a"\ngravity = [0, -9.81, 0.0] # {DOTS}',
    ],
)
def test_dots_in_texts_and_comments_are_no_keys(title):
    beam = "nodes.'A.'.position = [0, 0]"
    with pytest.raises(SceneError, match="found the name 'A\\.', accepted: a printable name without a dot"):
        parse(f"title = {title}\n{beam}", "toml")


def test_a_key_that_stands_twice_is_found_in_few_comparisons():
    compared = []

    class Key(str):
        __hash__ = str.__hash__

        def __eq__(self, other):
            compared.append(other)
            return str.__eq__(self, other)

    with pytest.raises(SceneError, match="the key '999' stands twice"):
        _table([(Key(min(i, 999)), i) for i in range(1001)])
    assert len(compared) < 5000


def test_a_syntax_error_names_its_line(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("title = 'a'\n\ngravity = [0, ,]\n")
    with pytest.raises(SceneError, match="at line 3, column 15"):
        load(path)


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    with pytest.raises(SceneError, match=r"none\.toml: there is no such file$"):
        load(tmp_path / "none.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(SceneError, match=r"folder\.toml: this is a folder, accepted: a scene file$"):
        load(tmp_path / "folder.toml")
    with pytest.raises(SceneError, match="the file cannot be read: "):
        load("a\0b.toml")

    def locked(*_):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "any.toml").touch()
    monkeypatch.setattr("os.open", locked)
    with pytest.raises(SceneError, match=r"any\.toml: the file cannot be read: Permission denied$"):
        load(tmp_path / "any.toml")


def test_a_format_is_toml_or_json():
    with pytest.raises(SceneError, match=r"^found the format 'yaml', accepted: toml, json"):
        parse("", "yaml")


def test_files_that_cannot_be_written(tmp_path):
    with pytest.raises(SceneError, match=r"scene\.txt: found the ending '\.txt', accepted: \.toml, \.json"):
        dump(SPOKEN, tmp_path / "scene.txt")
    with pytest.raises(SceneError, match=r"scene\.json: the file cannot be written: No such file or directory"):
        dump(SPOKEN, tmp_path / "none" / "scene.json")


def test_a_failed_write_leaves_the_old_file_alone(tmp_path, monkeypatch):
    path = tmp_path / "scene.json"
    path.write_text("old")

    def full(source, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(SceneError, match=r"scene\.json: the file cannot be written: No space left on device"):
        dump(SPOKEN, path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["scene.json"]


def test_toml_needs_a_package_to_be_written(tmp_path, monkeypatch):
    monkeypatch.setattr(scenefile, "tomli_w", None)
    with pytest.raises(SceneError, match=r"scene\.toml: TOML cannot be written without the package tomli-w"):
        dump(SPOKEN, tmp_path / "scene.toml")
    assert os.listdir(tmp_path) == []


def test_a_link_stays_a_link(tmp_path):
    path, link = tmp_path / "scene.json", tmp_path / "link.json"
    path.write_text("old")
    link.symlink_to(path)
    dump(SPOKEN, link)
    assert link.is_symlink()
    assert load(path) == SPOKEN
