"""The reference, made from the program: keys of scenes, names of answers, tolerances, all public docstrings.

Each function gives the text of a page; :func:`setup` writes them before Sphinx reads.
"""

import argparse
import functools
import importlib
import json
import pkgutil
import typing
from dataclasses import dataclass
from os import environ
from pathlib import Path

import numpydoc.numpydoc
from jinja2 import FileSystemLoader, Template
from jinja2.sandbox import SandboxedEnvironment
from numpydoc.docscrape import NumpyDocString, get_doc_object
from numpydoc.docscrape_sphinx import SphinxClassDoc, SphinxFunctionDoc, SphinxObjDoc
from pages import write_pages
from sphinx.application import Sphinx

import sfetcas
from sfetcas import cli
from sfetcas.description.answers import answers_table
from sfetcas.description.records import Record, plain
from sfetcas.description.scene import Scene

TABLES = {
    "Scene": ("The scene", "Keys at the top of a file."),
    "CrossSection": (
        "Sections",
        "`[sections.NAME]`. Each number but `nu`, `damping` and `drag` may vary along the member.",
    ),
    "Bilinear": ("Laws: bilinear", '`law = { type = "bilinear", ... }` of a section'),
    "RambergOsgood": ("Laws: Ramberg and Osgood", '`law = { type = "ramberg-osgood", ... }` of a section'),
    "Plateau": ("Laws: plateau", '`law = { type = "plateau", ... }` of a section'),
    "MomentTable": ("Laws: table", '`law = { type = "table", ... }` of a section'),
    "StressStrain": ("Laws: stress over strain", '`law = { type = "stress-strain", ... }` of a section'),
    "Ribbon": ("Laws: ribbon", '`law = { type = "audoly-neukirch" }` of a section'),
    "Sadowsky": ("Laws: ribbon of Sadowsky", '`law = { type = "sadowsky" }` of a section'),
    "ElasticPlastic": ("Laws: elastic-plastic", '`law = { type = "elastic-plastic", ... }` of a section'),
    "Superelastic": ("Laws: superelastic", '`law = { type = "superelastic", ... }` of a section'),
    "Potential": ("Laws: potential", "`law = Potential(potential=...)` of a section, in Python"),
    "StretchBilinear": ("Laws of stretch: bilinear", '`stretch_law = { type = "bilinear", ... }` of a section'),
    "StretchTable": ("Laws of stretch: table", '`stretch_law = { type = "table", ... }` of a section'),
    "StretchPotential": ("Laws of stretch: potential", "`stretch_law = StretchPotential(...)` of a section, in Python"),
    "Relaxation": ("Sections: relaxation", "`relaxation = [{ ... }, ...]` of a section: its branches"),
    "Node": ("Nodes", "`[nodes.NAME]`"),
    "Member": ("Members", "`[members.NAME]`"),
    "Arc": ("Shapes: arc", '`shape = { type = "arc", ... }` of a member'),
    "Helix": ("Shapes: helix", '`shape = { type = "helix", ... }` of a member'),
    "Curvature": ("Shapes: curvature", '`shape = { type = "curvature", ... }` of a member'),
    "Spline": ("Shapes: spline", '`shape = { type = "spline", ... }` of a member'),
    "Spring": ("Springs", "`[springs.NAME]`. Signs stand under [conventions](../theory/conventions.md#signs)."),
    "Tendon": ("Tendons", "`[tendons.NAME]`: tendons that pull and chambers that push"),
    "Way": ("Tendons: way", "`way = [{ ... }, ...]` of a tendon: its parts in their order"),
    "Coil": ("Tendons: helix", "`helix = { ... }` of a part of the way of a tendon"),
    "Tube": ("Tubes", "`[tubes.NAME]`: tubes that share the centre line of members"),
    "Ring": ("Rings", "`[rings.NAME]`: nodes that slide along members"),
    "Load": ("Loads", "`[loads.NAME]`"),
    "Motion": ("Motions", "`[motions.NAME]`: prescribed displacements and rotations"),
    "Actuation": ("Actuations", "`[actuations.NAME]`: natural curvature and twist of members"),
    "MagneticField": ("Magnetic fields", "`[fields.NAME]`"),
    "FieldTable": ("Magnetic fields: table", "`table = { ... }` of a field: columns, or the CSV file of them"),
    "Magnet": ("Magnets", "`[magnets.NAME]`: magnetised members and dipoles"),
    "History": ("Histories", "`[histories.NAME]`"),
    "Contact": ("Contacts", "`[contacts.NAME]`: obstacles, and members that touch each other"),
    "Analysis": ("Analysis", "`[analysis]`"),
    "Until": ("Analysis: until", "`until = { ... }` of the analysis: what ends a motion early"),
    "Expect": ("Expect", "`[[expect]]`: a known value of the answer"),
    "Table": (
        "Varying numbers by values",
        "`{ at = [...], value = [...] }` instead of a number of a section or a profile",
    ),
    "Polynomial": (
        "Varying numbers as polynomials",
        "`{ polynomial = [...] }` instead of a number of a section or a profile",
    ),
    "Formula": (
        "Varying numbers by a formula",
        '`"..."` instead of a number of a section or a profile, and for a curvature of a shape',
    ),
}
"""Records that a scene is written with, by their heading and where they stand, in the order of the page."""


@dataclass(frozen=True)
class Key:
    """A key of a table of a scene, as its record explains it."""

    name: str
    kind: str
    meaning: str
    default: str


def records() -> dict[str, type[Record]]:
    """All records that a scene may hold, by name."""
    found: dict[str, type[Record]] = {}
    _collect(Scene, found)
    return found


def _collect(annotation: typing.Any, found: dict[str, type[Record]]) -> None:
    if isinstance(annotation, type) and issubclass(annotation, Record):
        if annotation.__name__ not in found:
            found[annotation.__name__] = annotation
            for field in annotation.model_fields.values():
                _collect(field.annotation, found)
    else:
        for part in typing.get_args(annotation):
            _collect(part, found)


def choices(annotation: typing.Any) -> set[typing.Any]:
    """Words that an annotation allows."""
    if typing.get_origin(annotation) is typing.Literal:
        return set(typing.get_args(annotation))
    return set().union(*(choices(part) for part in typing.get_args(annotation)))


def keys(record: type[Record]) -> list[Key]:
    """The keys of a record in the order of its docstring."""
    return [_key(record, entry) for entry in NumpyDocString(record.__doc__ or "")["Parameters"]]


def _key(record: type[Record], entry: typing.Any) -> Key:
    meaning, _, words = " ".join(line.strip() for line in entry.desc if line.strip()).partition("Default: ")
    field = record.model_fields[entry.name]
    if field.is_required():
        default = "needed"
    else:
        value = plain(field.get_default(call_default_factory=True))
        default = f"`{json.dumps(value)}`" if value not in (None, {}, []) else words.rstrip(".")
    return Key(field.alias or entry.name, entry.type, " ".join(meaning.split()), default)


def _markdown(text: str) -> str:
    """Text of a docstring as it stands in a cell of a table."""
    return text.replace(":func:`~sfetcas.switch`", "{py:func}`sfetcas.switch`").replace("``", "`").replace("|", "\\|")


def scene_tables() -> str:
    """A heading and a table for each record."""
    known, lines = records(), []
    for name, (heading, place) in TABLES.items():
        lines += [f"## {heading}", "", place, "", "| key | unit, shape | meaning | default |", "|---|---|---|---|"]
        for key in keys(known[name]):
            lines.append(f"| `{key.name}` | {key.kind} | {_markdown(key.meaning)} | {_markdown(key.default)} |")
        lines.append("")
    return "\n".join(lines)


BEGIN, END = "<!-- made from the program -->", "<!-- until here -->"
"""Marks around what a page takes from the program: such pages are read in the repository, too."""


def filled(text: str, made: str) -> str:
    """A page with what is made from the program between its marks."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{made.strip()}\n\n{END}{rest.partition(END)[2]}"


def command_help() -> str:
    """What each command says of itself."""
    environ["COLUMNS"] = "100"
    root = cli.parser()
    (commands,) = (action for action in root._actions if isinstance(action, argparse._SubParsersAction))
    named = {"sfetcas": root} | {f"sfetcas {name}": parser for name, parser in commands.choices.items()}
    return "\n".join(f"## {name}\n\n```text\n{parser.format_help()}```\n" for name, parser in named.items())


GROUPS = {
    "scenes": ("Scenes", ("description",)),
    "solving": ("Solving", ("analyses", "checks", "equilibria", "errors")),
    "paths": ("Paths", ("paths",)),
    "dynamics": ("Modes and motions", ("dynamics",)),
    "parameters": ("Parameters and identification", ("parametric",)),
    "design": ("Design", ("design",)),
    "trajectories": ("Optimal control", ("trajectories",)),
    "sweeps": ("Sweeps", ("sweeps",)),
    "code": ("Generated C", ("codegen",)),
    "underneath": ("Underneath", ("mechanics", "solvers", "mathematics")),
}
"""Pages of the public names: their titles and the folders that the names are from."""


def api_pages() -> dict[str, str]:
    """Pages of the public names, by file name."""
    rest, pages = dict(sfetcas._MODULES), {}
    for page, (title, folders) in GROUPS.items():
        names = [name for name in sorted(rest) if rest[name].partition(".")[0] in folders]
        blocks = [_autodoc(f"sfetcas.{rest.pop(name)}", name) for name in names]
        pages[page] = f"# {title}\n\n" + "\n".join(blocks)
    if rest:
        raise ValueError(f"public names without a page of the reference: {', '.join(rest)}")
    pages["pictures"] = "# Pictures\n\n" + "\n".join(
        _module(f"sfetcas.pictures.{name}") for name in ("plotting", "charts", "motions", "animation", "paraview")
    )
    pages["index"] = "# Python\n\n" + _toctree([*GROUPS, "pictures"])
    return pages


def _autodoc(module: str, name: str) -> str:
    is_class = isinstance(getattr(importlib.import_module(module), name), type)
    options = ":members:\n:inherited-members: BaseModel, tuple, NamedTuple, Enum\n" if is_class else ""
    return _rst(f".. auto{'class' if is_class else 'function'}:: sfetcas.{name}", options)


def _rst(directive: str, options: str) -> str:
    indented = "".join(f"   {line}\n" for line in options.splitlines())
    return f"```{{eval-rst}}\n{directive}\n{indented}```\n"


def _module(name: str) -> str:
    # These have their place among the public names, wherever they are known, too.
    module = importlib.import_module(name)
    public = [public for public in sfetcas.__all__ if getattr(module, public, None) is getattr(sfetcas, public)]
    options = ":members:\n" + (f":exclude-members: {', '.join(public)}\n" if public else "")
    return f"## {name.removeprefix('sfetcas.')}\n\n" + _rst(f".. automodule:: {name}", options)


def _toctree(names: typing.Iterable[str]) -> str:
    return "```{toctree}\n" + "\n".join(names) + "\n```\n"


def module_pages() -> dict[str, str]:
    """Pages of the modules within the package, one for each folder, by file name."""
    folders: dict[str, list[str]] = {}
    for module in pkgutil.walk_packages(sfetcas.__path__, "sfetcas."):
        folder = module.name.split(".")[1] if module.name.count(".") > 1 or module.ispkg else "sfetcas"
        shown = module.ispkg or module.name in ("sfetcas.__main__", "sfetcas.tolerances") or folder == "pictures"
        folders.setdefault(folder, []).extend([] if shown else [module.name])
    pages = {
        folder: f"# {folder}\n\n" + "\n".join(map(_module, names)) for folder, names in sorted(folders.items()) if names
    }
    return {**pages, "index": "# Modules\n\n" + _toctree(pages)}


def _is_alias(app: Sphinx, what: str, name: str, value: object, skip: bool, options: object) -> bool | None:
    """Whether a member is left out: names of types have no signature that could be shown."""
    return True if typing.get_origin(value) is not None else None


def _set_formulas(app: Sphinx, what: str, name: str, value: object, options: object, lines: list[str]) -> None:
    """Keep the formulas of docstrings, indented lines before the first section, as they are written."""
    end = next((i for i, line in enumerate(lines) if line and set(line) == {"-"}), len(lines))
    for i in range(end - 1, 0, -1):
        begins = lines[i].startswith("    ") and not lines[i - 1].strip()
        before = next((line for line in reversed(lines[:i]) if line.strip()), "")
        if begins and not before.startswith("    ") and not before.startswith(("- ", "* ", "..", ">>>")):
            lines[i:i] = ["::", ""]


@functools.cache
def _template() -> Template:
    """The template of a docstring."""
    folder = Path(numpydoc.__path__[0]) / "templates"
    return SandboxedEnvironment(loader=FileSystemLoader(folder)).get_template("numpydoc_docstring.rst")


def _read_docstring(
    obj: object, what: str | None = None, doc: str | None = None, config: typing.Any = None, builder: object = None
) -> typing.Any:
    """A docstring as numpydoc reads it, which compiles the template anew for each of some thousands."""
    kinds = {"class_doc": SphinxClassDoc, "func_doc": SphinxFunctionDoc, "obj_doc": SphinxObjDoc}
    return get_doc_object(obj, what=what, doc=doc, config={**(config or {}), "template": _template()}, **kinds)


def _generate(app: Sphinx) -> None:
    reference = Path(app.srcdir) / "reference"
    made = {"scene": scene_tables(), "answers": answers_table()}
    write_pages(
        reference, {name: filled((reference / f"{name}.md").read_text("utf-8"), text) for name, text in made.items()}
    )
    write_pages(reference / "generated", {"commands": command_help()})
    write_pages(reference / "api", api_pages())
    write_pages(reference / "modules", module_pages())


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks which there are."""
    app.connect("builder-inited", _generate)
    numpydoc.numpydoc.get_doc_object = _read_docstring
    app.connect("autodoc-skip-member", _is_alias)
    # Before sections are made of them.
    app.connect("autodoc-process-docstring", _set_formulas, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
