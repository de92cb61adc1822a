"""Functions fit on a page. Kernels need not: a call is a cost there, and what they work on comes as arguments."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import colift

LINES = 60
PARAMETERS = 10
COMPILED = ("aside", "inline", "kernel", "register_jitable")
"""Decorators of compiled functions."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions() -> Iterator[tuple[str, Function]]:
    """Every function of the package that runs as Python, with the name to show."""
    home = Path(colift.__file__).parent
    for path in sorted(home.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, Function) and not is_decorated(node, *COMPILED):
                yield f"{path.relative_to(home)}: {node.name}", node


def is_decorated(function: Function, *names: str) -> bool:
    decorators = (ast.unparse(each).partition("(")[0] for each in function.decorator_list)
    return any(decorator in names for decorator in decorators)


def lines(function: Function) -> int:
    """Lines from ``def`` on, without the docstring."""
    first = function.body[0]
    told = ast.get_docstring(function) is not None
    docstring = (first.end_lineno or 0) - first.lineno + 1 if told else 0
    return (function.end_lineno or 0) - function.lineno + 1 - docstring


def parameters(function: Function) -> int:
    given = function.args
    return len([*given.posonlyargs, *given.args, *given.kwonlyargs])


def test_no_function_is_longer_than_a_page() -> None:
    found = dict(functions())
    assert len(found) > 1000
    assert {name: lines(each) for name, each in found.items() if lines(each) > LINES} == {}


def test_no_function_takes_many_parameters() -> None:
    """A command takes one for each of its options."""
    taken = {
        name: parameters(each)
        for name, each in functions()
        if not is_decorated(each, "app.command")
    }
    assert {name: number for name, number in taken.items() if number > PARAMETERS} == {}
