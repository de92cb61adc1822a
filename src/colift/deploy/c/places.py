"""Where a function's variables are set and used, and so where C declares them."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence

from colift.deploy.c.source import Source

_Path = tuple[tuple[int, int], ...]


class Places:
    """Of one function.

    Attributes
    ----------
    names : set of str
        Parameters and variables.
    loaded : set of str
        Those whose value is used.
    hoisted : list of str
        Variables that C declares at the top, as their first value may come from any of several places.

    """

    def __init__(self, source: Source) -> None:
        self._parameters = set(source.parameters)
        self._seen: dict[str, list[tuple[_Path, ast.Name]]] = {}
        self._counted: dict[str, list[ast.For]] = {}
        self._direct: set[int] = set()
        self._variables = {
            node.id
            for node in ast.walk(source.tree)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        } - self._parameters
        self._walk(source.body, (), frozenset())
        self.names = self._variables | self._parameters
        self.loaded = {
            node.id
            for node in ast.walk(source.tree)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
        }
        self.loaded |= {
            node.target.id
            for node in ast.walk(source.tree)
            if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name)
        }
        self.hoisted: list[str] = []
        self._declaring: set[int] = set()
        self._once: set[str] = set()
        for name, seen in self._seen.items():
            self._place(name, seen)

    def _walk(self, body: Sequence[ast.stmt], path: _Path, counting: frozenset[str]) -> None:
        for k, statement in enumerate(body):
            here = (*path, (id(body), k))
            inside = counting
            if isinstance(statement, ast.For) and isinstance(statement.target, ast.Name):
                self._counted.setdefault(statement.target.id, []).append(statement)
                inside = counting | {statement.target.id}
                self._note([statement.iter], here, counting, statement)
            elif isinstance(statement, ast.If | ast.While):
                self._note([statement.test], here, counting, statement)
            elif isinstance(statement, ast.Assign):  # the value is looked at first
                self._note([statement.value, *statement.targets], here, counting, statement)
            else:
                self._note([statement], here, counting, statement)
            if isinstance(statement, ast.For | ast.If | ast.While):
                self._walk(statement.body, here, inside)
                self._walk(statement.orelse, here, counting)

    def _note(
        self, nodes: Iterable[ast.AST], path: _Path, counting: frozenset[str], statement: ast.stmt
    ) -> None:
        for node in nodes:
            for each in ast.walk(node):
                if isinstance(each, ast.Name) and each.id in self._variables - counting:
                    self._seen.setdefault(each.id, []).append((path, each))
                    if isinstance(each.ctx, ast.Store) and isinstance(statement, ast.Assign):
                        self._direct.add(id(each))

    def _place(self, name: str, seen: list[tuple[_Path, ast.Name]]) -> None:
        """Declare it in the innermost block that holds all its places, if that begins with a value for it."""
        paths = [path for path, _ in seen]
        depth = 0
        while all(
            len(path) > depth
            and path[:depth] == paths[0][:depth]
            and path[depth][0] == paths[0][depth][0]
            for path in paths
        ):
            depth += 1
        stores = [node for _, node in seen if isinstance(node.ctx, ast.Store)]
        if len(stores) == 1 and id(stores[0]) in self._direct:
            self._once.add(name)
        path, first = seen[0]
        if len(path) == depth and id(first) in self._direct:
            self._declaring.add(id(first))
        elif stores:
            self.hoisted.append(name)

    def declares(self, target: ast.Name) -> bool:
        """Whether a variable is declared where this stores its first value."""
        return id(target) in self._declaring

    def stored_once(self, name: str) -> bool:
        """Whether a variable keeps its first value."""
        return name in self._once

    def misused(self, loop: ast.For) -> bool:
        """Whether something behind a loop looks at its counter."""
        assert isinstance(loop.target, ast.Name)
        name, end = loop.target.id, loop.end_lineno or loop.lineno
        for _, node in self._seen.get(name, []):
            if node.lineno > end:
                return isinstance(node.ctx, ast.Load)
        return False

    @staticmethod
    def changes(looked_at: ast.AST, body: Sequence[ast.stmt]) -> bool:
        """Whether these statements set a variable of an expression."""
        names = {each.id for each in ast.walk(looked_at) if isinstance(each, ast.Name)}
        return any(
            isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store) and each.id in names
            for statement in body
            for each in ast.walk(statement)
        )

    @staticmethod
    def depends(targets: ast.Tuple, values: ast.expr) -> bool:
        """Whether, of several targets at once, one changes what a later value or place looks at."""
        if not isinstance(values, ast.Tuple):
            return False
        for k, target in enumerate(targets.elts):
            for value, later in zip(values.elts[k + 1 :], targets.elts[k + 1 :], strict=True):
                index = later.slice if isinstance(later, ast.Subscript) else ast.Constant(0)
                looks = [*ast.walk(value), *ast.walk(index)]
                if isinstance(target, ast.Name):
                    if any(isinstance(each, ast.Name) and each.id == target.id for each in looks):
                        return True
                elif any(isinstance(each, ast.Subscript | ast.Call) for each in looks):
                    return True
        return False
