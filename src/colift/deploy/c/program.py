"""A kernel and all that it calls, as one file of C."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from colift.deploy.c.expressions import power
from colift.deploy.c.source import Source
from colift.deploy.c.translate import Translation
from colift.deploy.c.types import BOOL, INT, NOTHING, REAL, Array, Tuple, Type, bare
from colift.kernel import rounding
from colift.kernel.math.vectors import add_quad, eliminate, solve

_LEAST, _MOST = 2.0**-126, 3.4028234e38
"""Sizes of numbers of single precision."""

_HELPERS = {
    "min": "static inline {T} colift_min{S}({T} a, {T} b)\n{{\n    return b < a ? b : a;\n}}",
    "max": "static inline {T} colift_max{S}({T} a, {T} b)\n{{\n    return b > a ? b : a;\n}}",
    "whole": (
        "// a / b, rounded down\n"
        "static inline int colift_whole{S}(int a, int b)\n{{\n"
        "    const int found = a / b;\n    return a % b != 0 && (a < 0) != (b < 0) ? found - 1 : found;\n}}"
    ),
    "modulo": (
        "// What is left of a when b is taken away as often as it fits, rounded down\n"
        "static inline int colift_modulo{S}(int a, int b)\n{{\n"
        "    const int left = a % b;\n    return left != 0 && (left < 0) != (b < 0) ? left + b : left;\n}}"
    ),
    "modulo_real": (
        "// What is left of a when b is taken away as often as it fits, rounded down\n"
        "static inline {T} colift_modulo{S}({T} a, {T} b)\n{{\n"
        "    const {T} left = {fmod}(a, b);\n"
        "    if (left == {zero}) {{\n        return {copysign}({zero}, b);\n    }}\n"
        "    return (left < {zero}) != (b < {zero}) ? left + b : left;\n}}"
    ),
}


class Program:
    """Translated functions with the types and constants that they need.

    Parameters
    ----------
    single : bool
        Numbers of single precision.

    """

    as_they_are = (add_quad, eliminate, solve)
    """Functions that Numba has its own code for, and C takes as they are written."""

    def __init__(self, *, single: bool = False) -> None:
        self.single = single
        self.real = "float" if single else "double"
        self._made: dict[Any, Translation] = {}
        self._names: set[str] = set()
        self._structs: dict[Tuple, str] = {}
        self._constants: dict[str, str] = {}
        self._tables: dict[str, str] = {}
        self._helpers: dict[str, str] = {}
        self._shared: dict[Any, tuple[str, dict[str, int | str]]] = {}

    # What translations ask for

    def translation(self, function: Any, kinds: Sequence[Type]) -> Translation:
        """A function for these kinds of arguments."""
        key = function, tuple(kinds)
        if key not in self._made:
            self._made[key] = Translation(self, function, kinds, self._name(function))
        return self._made[key]

    def _name(self, function: Any) -> str:
        name = f"{_short(function.__module__)}_{function.__name__.strip('_')}"
        return self._unused(name)

    def _unused(self, name: str) -> str:
        found, count = name, 1
        while found in self._names:
            count += 1
            found = f"{name}_{count}"
        self._names.add(found)
        return found

    def spelled(self, kind: Type) -> str:
        """A type in C."""
        if isinstance(kind, Array):
            return self.real
        if isinstance(kind, Tuple):
            key = bare(kind)
            if key.made in self._shared:
                return self._shared[key.made][0]
            if key not in self._structs:
                self._structs[key] = self._unused(self._struct_name(key))
            return self._structs[key]
        return {REAL: self.real, INT: "int", BOOL: "bool", NOTHING: "void", None: "void"}[kind]

    def _struct_name(self, kind: Tuple) -> str:
        if kind.made is not None:
            return f"{_short(kind.made.__module__)}_{kind.made.__name__.lower()}"
        if kind.uniform:
            return f"{ {REAL: 'reals', INT: 'ints', BOOL: 'bools'}[kind.each[0]] }{len(kind.each)}"
        letters = {REAL: "r", INT: "i", BOOL: "b"}
        return "mixed_" + "".join(
            letters.get(e, "t") if isinstance(e, str) else "t" for e in kind.each
        )

    def lengths(self, kind: Tuple, name: str) -> dict[str, int | str]:
        """How long the fields of a parameter are, where that is known."""
        _, found = self._shared.get(kind.made, ("", {}))
        return {f: v.format(name) if isinstance(v, str) else v for f, v in found.items()}

    def counted(self, kind: Tuple) -> str | None:
        """The field of a port's struct that is as long as there are drones; None for what is no port's."""
        _, found = self._shared.get(kind.made, ("", {}))
        return next((name for name, length in found.items() if length == "{0}->n"), None)

    def number(self, value: float) -> str:
        """A number with a fraction."""
        if math.isnan(value):
            return "NAN"
        if math.isinf(value):
            return "INFINITY" if value > 0 else "-INFINITY"
        if not self.single:
            return repr(float(value))
        size = abs(value)
        if 0.0 < size < _LEAST or size > _MOST:  # a guard, not a quantity
            value = math.copysign(_LEAST if size < 1.0 else _MOST, value)
        return f"{_shortest(value)}f"

    def constant(self, source: Source, node: Any, value: float) -> str:
        """The name of a constant of a module."""
        module, name = source.place(node)
        if module == "math":
            return {"inf": "INFINITY", "nan": "NAN"}.get(name) or self._define(
                f"COLIFT_{name.upper()}", value
            )
        if self.single and module == rounding.__name__ and name in rounding.SINGLE:
            value = rounding.SINGLE[name]
        return self._define(f"{_short(module).upper()}_{name.strip('_').replace('.', '_')}", value)

    def _define(self, name: str, value: float) -> str:
        code = str(int(value)) if isinstance(value, int) else self.number(value)
        self._constants[name] = f"({code})" if code.startswith("-") else code
        return name

    def table(self, source: Source, node: Any, values: Sequence[float]) -> str:
        """The name of a tuple of constants of a module."""
        module, name = source.place(node)
        whole = all(isinstance(each, int) for each in values)
        found = f"{_short(module).upper()}_{name.strip('_').replace('.', '_')}"
        inside = ", ".join(str(int(v)) if whole else self.number(v) for v in values)
        kind = "int" if whole else self.real
        self._tables[found] = f"static const {kind} {found}[{len(values)}] = {{{inside}}};"
        return found

    def math(self, name: str) -> str:
        """A function of the C library."""
        return f"{name}f" if self.single else name

    def helper(self, name: str, kind: Type) -> str:
        """A function of a few lines that C's library does not have."""
        suffix = "_int" if kind == INT else ""
        key = f"{name}{suffix}"
        if name.startswith("power"):
            T = "int" if kind == INT else self.real
            body = f"return {power('a', int(name.removeprefix('power')))};"
            self._helpers[key] = f"static inline {T} colift_{key}({T} a)\n{{\n    {body}\n}}"
        else:
            pattern = _HELPERS["modulo_real" if name == "modulo" and kind == REAL else name]
            self._helpers[key] = pattern.format(
                T="int" if kind == INT else self.real, S=suffix, zero=self.number(0.0),
                fmod=self.math("fmod"), copysign=self.math("copysign"),
            )  # fmt: skip
        return f"colift_{key}"

    # The file

    def share(self, made: Any, name: str, lengths: dict[str, int | str]) -> None:
        """A class of named tuples whose type stands in the header under this name, and how long its fields are."""
        self._shared[made] = name, lengths

    def file(self, roots: Sequence[Translation], header: str) -> str:
        """The C file of these functions, and of all that they call."""
        order: list[Translation] = []

        def visit(each: Translation) -> None:
            if each not in order:
                for other in each.calls:
                    visit(other)
                order.append(each)

        for root in roots:
            visit(root)
        functions = [self._function(each, static=each not in roots) for each in order]
        text = "\n\n".join(functions)
        words = set(re.findall(r"\w+", text))
        defines = [f"#define {n} {v}" for n, v in sorted(self._constants.items()) if n in words]
        tables = [t for n, t in sorted(self._tables.items()) if n in words]
        helpers = [t for n, t in sorted(self._helpers.items()) if f"colift_{n}" in words]
        structs = self._typedefs(words)
        parts = [
            f'#include "{header}"\n\n#include <math.h>\n#include <stdbool.h>\n#include <stdlib.h>',
            "\n".join(defines), "\n".join(tables), *structs, *helpers, text,
        ]  # fmt: skip
        return "\n\n".join(part for part in parts if part) + "\n"

    def _typedefs(self, words: set[str]) -> list[str]:
        found: dict[str, str] = {}

        def add(kind: Tuple, name: str) -> None:
            text = self.fields(kind)
            for inner, other in self._structs.items():
                if other in text.split():
                    add(inner, other)
            found[name] = f"typedef struct {{\n{text}\n}} {name};"

        for kind, name in self._structs.items():
            if name in words:
                add(kind, name)
        return [*found.values()]

    def fields(self, kind: Tuple) -> str:
        """The fields of a struct."""
        if kind.uniform:
            return f"    {self.spelled(kind.each[0])} at[{len(kind.each)}];"
        lines = []
        for name, each in zip(kind.names(), kind.each, strict=True):
            if each == NOTHING:
                continue
            mark = "const " if isinstance(each, Array) and each.const else ""
            star = "*" if isinstance(each, Array) else ""
            lines.append(f"    {mark}{self.spelled(each)} {star}{name};")
        return "\n".join(lines)

    def _function(self, made: Translation, *, static: bool) -> str:
        told = f"{made.source.module.removeprefix('colift.')}.{made.source.name}"
        comment = _comment(made.source.doc, told)
        body = "\n".join(wrapped(line) for line in made.lines)
        mark = "static " if static else ""
        return f"{comment}\n{wrapped(mark + made.signature())}\n{{\n{body}\n}}"


_ROLE = re.compile(r":(?:\w+:)?\w+:`~?([^`]*)`")


def _comment(doc: str, told: str) -> str:
    text = _ROLE.sub(lambda m: m.group(1).removeprefix("colift."), doc).replace("``", "")
    lines = [*(text.splitlines() or []), f"({told})"]
    return "\n".join(f"// {line}".rstrip().rstrip("\\") for line in lines)


def _short(module: str) -> str:
    """A module's name without the rooms in which it stands."""
    parts = module.split(".")
    if module.startswith("colift.control."):
        parts = parts[3:] or parts
    elif module.startswith("colift.kernel."):
        parts = parts[-1:]
    return "_".join(part.strip("_") for part in parts)


def _shortest(value: float) -> str:
    """The shortest decimal that is this number in single precision."""
    import numpy as np

    text = np.format_float_scientific(np.float32(value), unique=True, trim="0")
    plain = repr(float(text))
    return plain if "e" in plain or "." in plain else f"{plain}.0"


def wrapped(line: str, width: int = 110) -> str:
    """A line of C broken at spaces."""
    code, mark, comment = line.partition(" // ")
    indent = len(line) - len(line.lstrip())
    if len(code) <= width or code.lstrip().startswith("//"):
        return line
    lines, rest = [], code
    more = " " * (indent + 8)
    while len(rest) > width:
        at = rest.rfind(" ", indent + 12, width)
        if at < 0:
            break
        lines.append(rest[:at])
        rest = more + rest[at + 1 :]
    lines.append(rest)
    head = [" " * indent + "// " + comment] if mark else []
    return "\n".join([*head, *lines])
