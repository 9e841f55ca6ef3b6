"""CasADi functions as C code, loadable or static, and tables of constants in C."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from .arrays import Array

__all__ = ["functions_in_c", "in_lines", "loadable", "sizes_of", "table"]


DEFINITION = re.compile(r"^(?:static )?(?:int|void|double|casadi_real|casadi_int|const \w+\*) (\w+)\(")
"""First line of a function in generated code."""


def _written(functions: Sequence[ca.Function], name: str, options: dict[str, Any]) -> str:
    """What CasADi writes, without its remarks, which list every entry of every matrix."""
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": False, "verbose": False, **options})
    for function in functions:
        generator.add(function)
    return str(generator.dump())


def loadable(function: ca.Function) -> str:
    """A function as C code that CasADi can load once it is compiled."""
    return _written([function], function.name(), {})


def functions_in_c(functions: Sequence[ca.Function], prefix: str, roots: Iterable[str]) -> str:
    """Functions as static C code without anything unreachable from the roots; it needs only the C math library.

    Parameters
    ----------
    functions : the functions
    prefix : prefix of all names that CasADi generates
    roots : names of functions called from outside; also of CasADi's runtime, as ``casadi_ldl``
    """
    text = _written(functions, prefix, {"with_export": False, "casadi_int": "int"})
    # Splines are called by the definition of their name.
    head, chunks = _chunks(re.sub(r"^(?!#)(.*)CASADI_PREFIX\((\w+)\)\(", r"\1casadi_\2(", text, flags=re.MULTILINE))
    wanted, reached = list(roots), set[str]()
    while wanted:
        name = wanted.pop()
        if name in chunks and name not in reached:
            reached.add(name)
            wanted += NAME.findall(chunks[name])
    head = "\n".join(
        line for line in head.splitlines() if not line.startswith("#define casadi_") or _kept(line, reached)
    )
    text = "\n".join([head, *(chunk for name, chunk in chunks.items() if name in reached)])
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


NAME = re.compile(r"\b[A-Za-z_]\w*")

TABLE = re.compile(r"^static const \w+ (\w+)\[")


def _kept(line: str, reached: set[str]) -> bool:
    """Whether a definition of a name is of something that is there."""
    name = line.split()[1]
    # What has arguments is a function of one line.
    return "(" in name or name in reached or name in ("casadi_real", "casadi_int")


def _chunks(text: str) -> tuple[str, dict[str, str]]:
    """What stands before all definitions, and functions and tables by their names, in order and static."""
    # Nothing here has a name outside: the frames of C++ are for what has.
    text = re.sub(r'#ifdef __cplusplus\n(extern "C" \{|\} /\* extern "C" \*/)\n#endif\n', "", text)
    head: list[str] = []
    chunks: dict[str, list[str]] = {}
    name = None
    for line in map(str.rstrip, text.splitlines()):
        match = DEFINITION.match(line) or TABLE.match(line)
        if name is None and match:
            name = match.group(1)
            chunks[name] = [line if line.startswith("static ") else f"static {line}"]
        elif name is not None:
            chunks[name].append(line)
        elif not line.startswith("/*") or not chunks:
            head.append(line)
            continue
        else:
            continue
        if line.startswith("}") or line.endswith("};") or (match and line.endswith("}")):
            chunks[name].append("")
            name = None
    return "\n".join(head), {name: "\n".join(lines) for name, lines in chunks.items()}


def sizes_of(functions: Iterable[ca.Function]) -> dict[str, int]:
    """Sizes of the work arrays that functions need when called one after the other."""
    functions = list(functions)
    return {
        "arg": max(3, *(f.sz_arg() for f in functions)),
        "res": max(5, *(f.sz_res() for f in functions)),
        "iw": max(1, *(f.sz_iw() for f in functions)),
        "w": max(1, *(f.sz_w() for f in functions)),
    }


def table(name: str, values: Array, kind: str = "double") -> str:
    """A constant array (...) in C; an empty one has a single zero, since C has no empty arrays."""
    flat = np.asarray(values).ravel()
    texts = [_double(x) if kind == "double" else str(int(x)) for x in flat.tolist()] or ["0"]
    # There may be tens of thousands: without spaces.
    inner = in_lines(texts)
    return f"static const {kind} {name}[{len(texts)}] = {{\n{inner}\n}};\n"


def in_lines(texts: Sequence[str]) -> str:
    """Constants with commas between them, in lines of at most 120 characters unless one is longer."""
    lines, line = [], ""
    for text in texts:
        if len(line) + len(text) > 118:
            lines.append(line)
            line = ""
        line += f"{text},"
    return "\n".join([*lines, line]).rstrip(",")


def _double(x: float) -> str:
    if not np.isfinite(x):
        return "HUGE_VAL" if x > 0.0 else "-HUGE_VAL"
    text = repr(x)
    # A negative zero is none where it is a whole number.
    return text if text == "-0.0" else text.removesuffix(".0")
