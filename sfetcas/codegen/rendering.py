"""Common parts of all exports to C: names, tables, constants, manifest, build files."""

from __future__ import annotations

import abc
import json
import re
import textwrap
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import casadi as ca
import numpy as np

from ..description.scene import Scene
from ..mathematics.arrays import Array
from ..mathematics.source import functions_in_c, sizes_of, table
from ..mechanics.model import Model
from ..parametric.arguments import Arguments, limits_of
from ..parametric.results import Results
from ..quoting import (
    c_comment,
    c_string,
    identifiers,
    in_docstring,
    markdown,
    markdown_cell,
    python_string,
    shell_word,
)

__all__ = ["Status", "Writer", "defined", "enumerated", "filled", "numbers", "optimised", "row", "rows", "template"]

Status = tuple[str, int, str]
"""A result code of a call in C: name, number, meaning."""

WARNINGS = """#if defined(__GNUC__)
/* What CasADi generates takes arguments that it may not need. */
#pragma GCC diagnostic ignored "-Wunused-parameter"
/* Nor is all of the core called. */
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-braces"
#endif
"""


def template(name: str) -> str:
    """The text of a template, a file of the folder ``templates``."""
    return resources.files(__package__).joinpath("templates").joinpath(name).read_text()


def optimised(level: str, text: str) -> str:
    """Code in C for which GCC takes another level of optimisation; without one the code as it is."""
    if not level:
        return text
    condition = "#if defined(__GNUC__) && !defined(__clang__)"
    begin = f'{condition}\n#pragma GCC push_options\n#pragma GCC optimize ("{level}")\n#endif\n'
    return f"{begin}{text}{condition}\n#pragma GCC pop_options\n#endif\n"


def filled(text: str, values: dict[str, object]) -> str:
    """A template with its ``@marks@`` replaced by values."""
    return re.sub(r"@(\w+)@", lambda match: str(values[match.group(1)]), text)


def enumerated(values: Sequence[Status]) -> str:
    """Lines of a C enum with the meanings as comments."""
    last = len(values) - 1
    ends = ["," if i < last else "" for i in range(len(values))]
    return "\n".join(
        f"  {n} = {v}{end} /* {c_comment(what)} */" for (n, v, what), end in zip(values, ends, strict=True)
    )


def defined(constants: Mapping[str, float]) -> str:
    """Constants in C by their names."""
    return "".join(f"#define SF_{key} {value!r}\n" for key, value in constants.items())


def numbers(values: Array) -> str:
    """Numbers (any shape and unit) as C constants in one line, with all digits; 0.0 for an empty array."""
    return ", ".join(repr(float(x)) for x in np.asarray(values).ravel()) or "0.0"


def row(values: Array) -> str:
    """Numbers (n,) as C constants in lines of five, with all digits; 0.0 for nan, inf and an empty array."""
    texts = [repr(float(x)) if np.isfinite(x) else "0.0" for x in values] or ["0.0"]
    lines = [", ".join(texts[i : i + 5]) for i in range(0, len(texts), 5)]
    return ",\n   ".join(lines)


def rows(values: Sequence[Array]) -> str:
    """Arrays (n,) as the lines of a C initialiser of an array of arrays."""
    return ",\n".join(f"  {{{row(one)}}}" for one in values)


class Writer(abc.ABC):
    """The files of one export; a subclass for each kind of export gives templates, functions and tables.

    Parameters
    ----------
    name : str
        Prefix of all names in C.
    scene : Scene
    arguments : Arguments
    results : Results
    """

    header: str
    """Names of the templates of the header, the example, the check, the Python loader and the README."""
    example: str
    check: str
    loader: str | None
    readme: str
    bodies: tuple[str, ...]
    """Names of the templates of the driver, the C code that calls the generated functions."""
    optimisation = ""
    """Level of optimisation of the generated functions, where it is not that of the whole."""
    last: tuple[str, ...] = ("defaults.c",)
    """Names of the templates at its end."""

    def __init__(self, name: str, scene: Scene, arguments: Arguments, results: Results) -> None:
        self.name, self.scene, self.arguments, self.results = name, scene, arguments, results

    # -- what each kind gives -----------------------------------------------------------------------

    @property
    @abc.abstractmethod
    def functions(self) -> list[ca.Function]:
        """The CasADi functions that are written as C."""

    @property
    @abc.abstractmethod
    def statuses(self) -> list[Status]:
        """Result codes of a call."""

    @property
    @abc.abstractmethod
    def tables(self) -> list[str]:
        """Definitions of the constants and tables of the driver, in C."""

    @property
    @abc.abstractmethod
    def states(self) -> int:
        """Length of a state."""

    @property
    @abc.abstractmethod
    def memory(self) -> int:
        """Number of doubles that the driver needs beside the memory of the functions."""

    @property
    @abc.abstractmethod
    def own(self) -> dict[str, object]:
        """Values of marks in templates that only this kind has."""

    @property
    @abc.abstractmethod
    def cases(self) -> dict[str, object]:
        """Values of marks in the template of the check: arguments and the results computed in process."""

    @property
    @abc.abstractmethod
    def about(self) -> dict[str, Any]:
        """Entries of the manifest that only this kind has."""

    # -- files ----------------------------------------------------------------------------------------

    @property
    def model(self) -> Model:
        """The model on which the functions are based."""
        return self.arguments.model

    @property
    def limits(self) -> Array:
        """Least and largest accepted values of all numbers among the arguments, (2, numbers)."""
        return limits_of(self.arguments.arguments)

    @property
    def ranges(self) -> list[str]:
        """These as tables in C."""
        return [table(name, values) for name, values in zip(("sf_low", "sf_high"), self.limits, strict=True)]

    @property
    def where(self) -> str:
        """The dimension in words: ``space`` or ``the plane``."""
        return "space" if self.model.space else "the plane"

    def files(self) -> dict[str, str]:
        """The texts of all files by file name."""
        values = {**self._values(), **self.own}
        header = filled(template(self.header), values)
        parts = [
            "/* @title@\n *\n * Made by sfetcas; not meant to be read or changed. */",
            '#include "@name@.h"\n',
            WARNINGS,
            optimised(
                self.optimisation,
                functions_in_c(self.functions, self.name, (function.name() for function in self.functions)),
            ),
            "/* ---- tables ---- */\n",
            *self.tables,
            *(template(body) for body in (*self.bodies, *self.last)),
        ]
        source = filled("\n".join(parts), values)
        manifest = self._manifest()
        values |= self.cases | self._words(manifest)
        marks = ("entries_of_arguments", "entries_of_results", "put")
        values |= {mark: filled(template(f"{mark}.c"), values) for mark in marks}
        return {
            f"{self.name}.h": header,
            f"{self.name}.c": source,
            "manifest.json": json.dumps(manifest, indent=1) + "\n",
            "main.c": filled(template(self.example), values),
            "check.c": filled(template(self.check), values),
            **({f"{self.name}.py": filled(template(self.loader), values)} if self.loader else {}),
            **self.more(values),
            "Makefile": filled(template("Makefile"), values),
            "CMakeLists.txt": filled(template("CMakeLists.txt"), values),
            "README.md": filled(template(self.readme), values),
        }

    def more(self, values: dict[str, object]) -> dict[str, str]:
        """Texts of further files of this kind by file name, from the values of marks."""
        return {}

    def _values(self) -> dict[str, object]:
        name, upper = self.name, self.name.upper()
        title = self.scene.title.strip() or "an untitled scene"
        known, outputs = self.arguments.arguments, self.results.results
        sizes = sizes_of(self.functions)
        sizes["w"] = max(sizes["w"], self.arguments.expressions.total)
        statuses = [(f"{upper}_{key}", value, meaning) for key, value, meaning in self.statuses]
        return {
            "name": name,
            "NAME": upper,
            "title": c_comment(title),
            "title_in_python": in_docstring(title),
            "title_in_markdown": markdown(title),
            "casadi": ca.CasadiMeta.version(),
            "arguments_in_words": _in_words([one.name for one in known]),
            "n_arguments": len(self.arguments.defaults),
            "n_results": self.results.size,
            "n_states": self.states,
            "argument_places": _places(f"{upper}_ARG", [(a.name, len(a.default), a.unit) for a in known]),
            "result_places": _places(f"{upper}_RES", [(r.name, r.size, r.unit) for r in outputs]),
            "statuses": enumerated(statuses),
            "messages": "\n".join(f"    case {key}: return {c_string(meaning)};" for key, _, meaning in statuses),
            "defaults": numbers(self.arguments.defaults),
            "sz_state": max(1, self.states),
            "sz_p": max(1, len(self.arguments.defaults)),
            "sz_r": max(1, self.results.size),
            **{f"sz_{key}": value for key, value in sizes.items()},
        }

    def _memory_bytes(self) -> int:
        """Upper bound of the memory of a call, bytes, with pointers of eight bytes."""
        sizes = sizes_of(self.functions)
        work = max(sizes["w"], self.arguments.expressions.total)
        return 8 * (work + self.memory + sizes["arg"] + sizes["res"]) + 4 * (sizes["iw"] + 1)

    def _manifest(self) -> dict[str, Any]:
        """The manifest: sizes, and name, place, unit, shape and meaning of every argument and result."""
        arguments, first = [], 0
        known, outputs = self.arguments.arguments, self.results.results
        for identifier, one in zip(identifiers(a.name for a in known), known, strict=True):
            entry: dict[str, Any] = {"name": one.name, "constant": f"{self.name.upper()}_ARG_{identifier}"}
            shape = [] if one.components is None else [len(one.default)]
            entry |= {"first": first, "size": len(one.default), "shape": shape}
            within = "" if one.low is None else f", from {one.low:g} to {one.high:g}"
            entry |= {"unit": one.unit, "meaning": one.meaning + within}
            entry["default"] = one.default[0] if one.components is None else list(one.default)
            if one.components is not None:
                entry["components"] = list(one.components)
            if one.low is not None:
                entry["range"] = [one.low, one.high]
            arguments.append(entry)
            first += len(one.default)
        results, first = [], 0
        for identifier, result in zip(identifiers(r.name for r in outputs), outputs, strict=True):
            entry = {"name": result.name, "constant": f"{self.name.upper()}_RES_{identifier}", "first": first}
            entry |= {"size": result.size, "shape": list(result.shape)}
            entry |= {"unit": result.unit, "meaning": result.meaning}
            if result.member:
                entry["s"] = list(self.results.places[result.member])
            results.append(entry)
            first += result.size
        return {
            "name": self.name,
            "title": self.scene.title,
            "made_by": "sfetcas",
            "language": "C99",
            "dimension": self.model.dimension,
            "elements": self.model.mesh.elements,
            "element": self.model.element.name,
            "unknowns": self.arguments.expressions.total,
            **self.about,
            "sizes": {
                "arguments": len(self.arguments.defaults),
                "results": self.results.size,
                "state": self.states,
                "memory_bytes": self._memory_bytes(),
            },
            "arguments": arguments,
            "results": results,
            "statuses": {key: {"value": value, "meaning": meaning} for key, value, meaning in self.statuses},
        }

    def _words(self, manifest: dict[str, Any]) -> dict[str, object]:
        """Values of marks for the tables of the README and the example."""
        arguments, results = manifest["arguments"], manifest["results"]
        example = arguments[0] if arguments else None
        name = "" if example is None else example["name"] + ("" if example["size"] == 1 else ".0")
        return {
            "memory_kb": manifest["sizes"]["memory_bytes"] // 1000 + 1,
            "first_argument": shell_word(f"{name}=1.5" if example else ""),
            "first_result": in_docstring(python_string(results[0]["name"] if results else "message")),
            "argument_entries": "\n".join(map(_entry, arguments)),
            "result_entries": "\n".join(map(_entry, results)),
            "argument_rows": "\n".join(
                f"| {markdown_cell(one['name'])} | {one['size']} | {one['unit']} | {_short(one['default'])} "
                f"| {markdown(one['meaning'])} |"
                for one in arguments
            ),
            "result_rows": "\n".join(
                f"| {markdown_cell(one['name'])} | {' x '.join(map(str, one['shape'])) or '1'} | {one['unit']} "
                f"| {markdown(one['meaning'])} |"
                for one in results
            ),
            "status_rows": "\n".join(f"| {key} = {value} | {meaning} |" for key, value, meaning in self.statuses),
        }

    def units(self, results: Sequence[Array]) -> Array:
        """Reference (results,) for the comparison of each number in the check, in the unit of the result.

        The largest size of any result of its kind in all cases, of forces and energies not less than ``FELT`` of the
        units of the model; 1 for kinds that are zero.
        """
        largest: dict[str, float] = {}
        for one in self.results.results:
            if one.unit in ("N", "N m", "J"):
                largest[one.asked.kind.key or one.name] = FELT * float(self.model.scales.of(one.unit))
        kinds = [kind for one in self.results.results for kind in [one.asked.kind.key or one.name] * one.size]
        for values in results:
            for kind, value in zip(kinds, values.tolist(), strict=True):
                if np.isfinite(value):
                    largest[kind] = max(largest.get(kind, 0.0), abs(value))
        return np.array([largest.get(kind) or 1.0 for kind in kinds])


FELT = 1e-5
"""Share of the units of the model below which forces are compared as if they were so large: those of what is free of
stress are rounding, 1e-14 of the units.
"""


def _in_words(names: Sequence[str]) -> str:
    words = textwrap.fill(
        ", ".join(map(c_comment, names)) if names else "loads of the scene", 110, initial_indent=" * "
    )
    return words.replace("\n", "\n * ")


def _places(prefix: str, sizes: Sequence[tuple[str, int, str]]) -> str:
    """A C enum of the positions at which arguments or results (name, size, unit) begin."""
    if not sizes:
        return ""
    names, first, found = identifiers(name for name, _, _ in sizes), 0, []
    for identifier, (name, size, unit) in zip(names, sizes, strict=True):
        count = "1 number" if size == 1 else f"{size} numbers"
        found.append((f"{prefix}_{identifier}", first, f"{name}: {count}, {unit}"))
        first += size
    return f"enum {{\n{enumerated(found)}\n}};\n"


def _entry(one: dict[str, Any]) -> str:
    return f"  {{{c_string(one['name'])}, {one['first']}, {one['size']}, {c_string(one['unit'])}}},"


def _short(value: float | list[float]) -> str:
    return ", ".join(f"{x:.6g}" for x in value) if isinstance(value, list) else f"{value:.6g}"
