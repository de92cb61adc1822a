"""The Python source of a function: its tree, its comments, and what its names stand for."""

from __future__ import annotations

import ast
import builtins
import importlib
import inspect
import io
import sys
import textwrap
import tokenize
from functools import cache
from pathlib import Path
from typing import Any

from colift.errors import ColiftError

_NOT_FOR_READERS = ("# type:", "# fmt:", "# noqa", "# pragma")


class UntranslatableError(ColiftError):
    """A line that C would not do in the same way, or that nobody has taught the translator."""


class Source:
    """Of one function.

    Attributes
    ----------
    tree : ast.FunctionDef
    doc : str
        Its docstring.
    comments : dict of int to str
        Those that stand in lines of their own, by line of the file.
    beside : dict of int to str
        Those behind code.

    """

    def __init__(self, function: Any) -> None:
        self.function = function
        self.module: str = function.__module__
        self.name: str = function.__name__
        self.file = Path(inspect.getfile(function))
        lines, self.first = inspect.getsourcelines(function)
        text = textwrap.dedent("".join(lines))
        tree = ast.parse(text).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self.tree = ast.increment_lineno(tree, self.first - 1)
        self.doc = ast.get_docstring(tree) or ""
        self.body = tree.body[1:] if self.doc else tree.body
        self.parameters = [each.arg for each in tree.args.args]
        self.comments, self.beside = _comments(text, self.first - 1)
        self._names = {**vars(builtins), **function.__globals__}
        self._names.update(inspect.getclosurevars(function).nonlocals)

    def refuse(self, node: ast.AST, why: str) -> UntranslatableError:
        """The error for a piece of code, with file and line."""
        code = " ".join(ast.unparse(node).split())
        code = code if len(code) < 100 else f"{code[:97]}..."
        line = getattr(node, "lineno", self.first)
        return UntranslatableError(f"{self.file}:{line}: {why}: {code}")

    def known(self, node: ast.expr) -> Any:
        """What a name of the module, or a dotted one, stands for; ``LookupError`` for any other expression."""
        if isinstance(node, ast.Name):
            return self._names[node.id]
        if isinstance(node, ast.Attribute):
            owner = self.known(node.value)
            if hasattr(owner, node.attr):
                return getattr(owner, node.attr)
        raise LookupError

    def place(self, node: ast.expr) -> tuple[str, str]:
        """Module and dotted name under which a known value was defined."""
        names: list[str] = []
        while isinstance(node, ast.Attribute):
            names.insert(0, node.attr)
            node = node.value
        assert isinstance(node, ast.Name)
        module, names = self.module, [node.id, *names]
        while True:
            module, first = _defined(module, names[0])
            if first:
                return module, ".".join([first, *names[1:]])
            names = names[1:]


@cache
def _imports(module: str) -> dict[str, tuple[str, str]]:
    """Name in a module: where ``from ... import`` took it from."""
    file = sys.modules[module].__file__
    found = {}
    for node in ast.parse(Path(file).read_text("utf-8")).body if file else ():
        if isinstance(node, ast.ImportFrom) and node.module:
            for each in node.names:
                found[each.asname or each.name] = node.module, each.name
        elif isinstance(node, ast.Import):
            for each in node.names:
                found[each.asname or each.name] = each.name, ""
    return found


def _defined(module: str, name: str) -> tuple[str, str]:
    """The module in which a name is defined, and its name there; no name where it is a module itself."""
    if not module.startswith("colift."):
        return module, name
    while name in _imports(module):
        module, name = _imports(module)[name]
        if not name:
            return module, ""
        inside = f"{module}.{name}"
        if inside in sys.modules:
            return inside, ""
        if not module.startswith("colift."):
            break
        importlib.import_module(module)
    return module, name


def _comments(text: str, shift: int) -> tuple[dict[int, str], dict[int, str]]:
    own: dict[int, str] = {}
    beside: dict[int, str] = {}
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type != tokenize.COMMENT or token.string.startswith(_NOT_FOR_READERS):
            continue
        row, column = token.start
        alone = not lines[row - 1][:column].strip()
        (own if alone else beside)[row + shift] = token.string.lstrip("# ")
    return own, beside
