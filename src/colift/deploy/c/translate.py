"""One Python function for one kind of arguments in C.

What is translated follows Python's and Numba's rules: the order in which numbers are added, ``min`` and ``max`` with what is
not a number, powers as products. A line that C would not do in the same way is refused.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from colift.deploy.c.expressions import ATOM, BINARY, SHIFT, SUM, UNKNOWN, Expressions, Value, local
from colift.deploy.c.places import Places
from colift.deploy.c.source import Source
from colift.deploy.c.types import (
    BOOL,
    INT,
    NOTHING,
    REAL,
    Array,
    Function,
    Tuple,
    Type,
    joined,
    rooted,
)

if TYPE_CHECKING:
    from colift.deploy.c.program import Program

_PASSES = 20
"""Most times that a function is looked through until all types are known."""


class Translation(Expressions):
    """A function for one kind of arguments.

    Attributes
    ----------
    name : str
        In C.
    result : type
        Of what it returns.

    """

    def __init__(self, program: Program, function: Any, kinds: Sequence[Type], name: str) -> None:
        self.program, self.source, self.name = program, Source(function), name
        self.result: Type | None = None
        self.written, self.lengths, self.types = set(), [], {}
        self.places = self.outer = Places(self.source)
        if len(kinds) != len(self.source.parameters):
            self.refuse(self.source.tree, "called with other arguments than it names")
        self._counting: list[str] = []
        self._whole: list[str] = []
        self.parameters = {
            each: self._parameter(each, kind)
            for each, kind in zip(self.source.parameters, kinds, strict=True)
        }
        for _ in range(_PASSES):
            before = dict(self.types), set(self.written), self.result
            self._pass(final=False)
            if before == (self.types, self.written, self.result):
                break
        else:
            self.refuse(self.source.tree, "the types of its variables do not settle")
        self._pass(final=True)

    def _parameter(self, name: str, kind: Type) -> Value:
        if isinstance(kind, Function):
            return Value("", kind, known=kind.made)
        struct = isinstance(kind, Tuple) and kind.made is not None
        lengths = self.program.lengths(kind, local(name)) if struct else {}
        return Value(local(name), rooted(kind, name, lengths), pointer=struct)

    def signature(self) -> str:
        """Its head in C."""
        given = []
        for name, value in self.parameters.items():
            kind = value.type
            if isinstance(kind, Function):
                continue
            if value.pointer:
                given.append(f"const {self.program.spelled(kind)} *{local(name)}")
            elif isinstance(kind, Array):
                given.append(self.declaration(kind, name))
            else:
                given.append(f"{self.program.spelled(kind)} {local(name)}")
        given += [f"int {name}_length" for name in self.lengths]
        result = self.program.spelled(self.result)
        return f"{result} {self.name}({', '.join(given) or 'void'})"

    def _pass(self, *, final: bool) -> None:
        self.final, self.lines, self.calls = final, [], []
        self._indent, self._fresh, self._told = 1, 0, self.source.first
        returns = [node for node in ast.walk(self.source.tree) if isinstance(node, ast.Return)]
        if not any(node.value for node in returns):
            self.result = NOTHING
        for name, value in self.parameters.items():
            if name not in self.places.loaded and not isinstance(value.type, Function):
                self.emit(f"(void){local(name)};")
        for name in self.places.hoisted:
            if name in self.places.loaded:
                self._declare(name)
        self._block(self.source.body)
        words = Counter(re.findall(r"\w+", " ".join(self.lines)))
        for name, kind in self.types.items():
            if isinstance(kind, Array) and words[local(name)] == 1:  # only its length is looked at
                self.lines = [each for each in self.lines if f" *{local(name)} = " not in each]

    def _declare(self, name: str) -> None:
        kind = self.types.get(name, REAL)
        zero = {REAL: self.program.number(0.0), INT: "0", BOOL: "false"}
        if isinstance(kind, Tuple):
            initial = "{{0}}" if kind.uniform else "{0}"
        else:
            initial = "0" if isinstance(kind, Array) else zero[kind]
        self.emit(f"{self.declaration(kind, name)} = {initial};")

    # Statements

    def _block(self, body: Sequence[ast.stmt]) -> None:
        for statement in body:
            self._comments_before(statement.lineno)
            found = getattr(self, f"_do_{type(statement).__name__}", None)
            if found is None:
                self.refuse(statement, "no such statement in C")
            begin = len(self.lines)
            found(statement)
            if len(self.lines) > begin:
                self._comment_beside(statement, begin)

    def _comments_before(self, line: int) -> None:
        for at in range(self._told, line):
            if at in self.source.comments:
                self.emit(f"// {self.source.comments[at]}")
        self._told = max(self._told, line)

    def _comment_beside(self, statement: ast.stmt, begin: int) -> None:
        simple = not isinstance(statement, ast.For | ast.If | ast.While)
        last = statement.end_lineno if simple else statement.lineno
        for at in sorted({statement.lineno, last or 0}):
            if at in self.source.beside:
                self.lines[begin] += f" // {self.source.beside[at]}"

    def _inside(self, body: Sequence[ast.stmt]) -> None:
        self._indent += 1
        self._block(body)
        self._indent -= 1

    def _do_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.emit(f"{self.value(node.value).code};")

    def _do_Pass(self, node: ast.Pass) -> None:
        pass

    def _do_Break(self, node: ast.Break) -> None:
        if self._whole[-1]:
            self.emit(f"{self._whole[-1]} = false;")
        self.emit("break;")

    def _do_Continue(self, node: ast.Continue) -> None:
        self.emit("continue;")

    def _do_Return(self, node: ast.Return) -> None:
        if node.value is None:
            self.emit("return;")
            return
        value = self.value(node.value)
        merged = value.type if self.result is None else joined(self.result, value.type)
        if merged is None or isinstance(merged, Function) or merged == NOTHING:
            self.refuse(node, "returns values of different kinds")
        self.result = merged
        self.emit(f"return {self.converted(value, merged, node)};")

    def _do_If(self, node: ast.If) -> None:
        self.emit(f"if ({self.condition(self.value(node.test), node.test).code}) {{")
        self._inside(node.body)
        rest = node.orelse
        while len(rest) == 1 and isinstance(rest[0], ast.If):
            other = rest[0]
            if other.col_offset != node.col_offset:
                break
            self.emit(f"}} else if ({self.truth(other.test)}) {{")
            self._inside(other.body)
            rest = other.orelse
        if rest:
            self.emit("} else {")
            self._inside(rest)
        self.emit("}")

    def _do_While(self, node: ast.While) -> None:
        if node.orelse:
            self.refuse(node, "a loop with else")
        self.emit(f"while ({self.truth(node.test)}) {{")
        self._loop(node.body, "")

    def _do_For(self, node: ast.For) -> None:
        call, target = node.iter, node.target
        if (
            not isinstance(target, ast.Name)
            or not isinstance(call, ast.Call)
            or ast.unparse(call.func) != "range"
        ):
            self.refuse(node, "only loops over a range")
        if self.places.misused(node):
            self.refuse(node, f"{target.id} is used behind the loop")
        given = [self.value(each) for each in call.args]
        if any(each.type != INT for each in given):
            self.refuse(call, "a range of what is no integer")
        name, one = local(target.id), self.literal(1, node)
        step = given[2] if len(given) == 3 else one
        if step.known in (UNKNOWN, 0):
            self.refuse(call, "a step that is known only when it runs")
        start, stop = (self.literal(0, node), given[0]) if len(given) == 1 else given[:2]
        begin, end = f"int {name} = {start.code}", stop.within(SHIFT)
        if self.places.changes(call, node.body) or stop.reads or stop.acts:
            end = self.unused(f"{name}_end")
            begin = f"{begin}, {end} = {stop.code}"
        sign, ahead = "<" if step.known > 0 else ">", f"{name} += {step.code}"
        ahead = {1: f"++{name}", -1: f"--{name}"}.get(step.known, ahead)
        whole = self.unused(f"whole{node.lineno - self.source.first}") if node.orelse else ""
        if whole:
            self.emit(f"bool {whole} = true;")
        self.emit(f"for ({begin}; {name} {sign} {end}; {ahead}) {{")
        self._counting.append(target.id)
        before = self.types.get(target.id)
        self.types[target.id] = INT
        self._loop(node.body, whole)
        self._counting.pop()
        if before is not None:
            self.types[target.id] = before
        if whole:
            self.emit(f"if ({whole}) {{")
            self._inside(node.orelse)
            self.emit("}")

    def _loop(self, body: Sequence[ast.stmt], whole: str) -> None:
        """The body of a loop; ``whole`` is the variable that says whether none of it breaks."""
        self._whole.append(whole)
        self._inside(body)
        self._whole.pop()
        self.emit("}")

    def _do_Assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            place = self._store(target, value, node)
            if value.known is UNKNOWN and place is not None:
                value = place

    def _unpack(self, target: ast.Tuple, value: Value, node: ast.Assign) -> None:
        """Several targets at once, in the way of Python: first all values, then all places."""
        kind = value.type
        if isinstance(kind, Array) and not kind.inner and kind.length == len(target.elts):
            codes = (f"{value.within(ATOM)}[{k}]" for k in range(len(target.elts)))
            value = self.gathered([Value(code, REAL, reads=True) for code in codes])
        if not isinstance(value.type, Tuple) or len(value.type.each) != len(target.elts):
            self.refuse(node, "not as many values as places")
        if value.parts is None and not value.pointer and not value.code.isidentifier():
            value = self.kept(value, node)
        parts = [self.part(value, k) for k in range(len(target.elts))]
        if self.places.depends(target, node.value):
            parts = [p if p.known is not UNKNOWN else self.kept(p, node) for p in parts]
        for each, part in zip(target.elts, parts, strict=True):
            self._store(each, part, node)

    def _store(self, target: ast.expr, value: Value, node: ast.Assign) -> Value | None:
        """Set one place; what is there then, or None for what nobody looks at."""
        if isinstance(target, ast.Name):
            return self._set(target, value, node)
        if isinstance(target, ast.Tuple):
            self._unpack(target, value, node)
            return None
        if isinstance(target, ast.Subscript) and ast.unparse(target.slice) == ":":
            self._fill(target, value, node)
            return None
        place = self._place(target, node)
        index = target.slice if isinstance(target, ast.Subscript) else target
        if value.acts and any(isinstance(each, ast.Subscript) for each in ast.walk(index)):
            self.refuse(node, "which comes first, the call or the look for the place, is open in C")
        if value.type not in (REAL, INT):
            self.refuse(node, "no number for a place in an array")
        self.emit(f"{place.code} = {self.converted(value, REAL, node)};")
        return place

    def _set(self, target: ast.Name, value: Value, node: ast.Assign) -> Value | None:
        name = target.id
        if name in self._counting:
            self.refuse(node, f"{name} counts a loop")
        if value.type == NOTHING or isinstance(value.type, Function):
            self.refuse(node, "this is no value")
        known = self.parameters.get(name)
        before = self.types.get(name) if known is None else known.type
        kind = value.type if before is None else joined(before, value.type)
        if kind is None or (
            known is not None and (kind != known.type or isinstance(kind, Array | Tuple))
        ):
            self.refuse(node, f"{name} is now of one kind, now of another")
        if known is None:
            self.types[name] = kind
        if name not in self.places.loaded:
            if value.acts:
                self.emit(f"(void){value.code};")
            return None
        code = self.converted(value, kind, node)
        if self.places.declares(target):
            once = self.places.stored_once(name)
            self.emit(f"{self.declaration(kind, name, const=once)} = {code};")
        else:
            self.emit(f"{local(name)} = {code};")
        return Value(local(name), kind)

    def _fill(self, target: ast.Subscript, value: Value, node: ast.AST) -> None:
        """Set all places of an array."""
        array = self.value(target.value)
        if not isinstance(array.type, Array) or array.type.inner or value.known is UNKNOWN:
            self.refuse(node, "no constant for a row of numbers")
        self.write_to(array.type, node)
        length, k = self.length(array.type.length, node).within(SUM), self.unused("k")
        self.emit(f"for (int {k} = 0; {k} < {length}; ++{k}) {{")
        self.emit(f"    {array.within(ATOM)}[{k}] = {self.converted(value, REAL, node)};")
        self.emit("}")

    def _place(self, target: ast.expr, node: ast.AST) -> Value:
        """A place in an array."""
        place = self.value(target)
        if not isinstance(target, ast.Subscript) or place.type != REAL:
            self.refuse(node, "no single place")
        return place

    def _do_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) not in (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.BitOr):
            self.refuse(node, "no such operator in C")
        sign, _ = BINARY[type(node.op)]
        value, target = self.value(node.value), node.target
        if not isinstance(target, ast.Name):
            place = self._place(target, node)
            self.operands(node, node.op, REAL, value.type)
            if value.acts:
                self.refuse(
                    node, "which comes first, the call or the look at an array, is open in C"
                )
            self.emit(f"{place.code} {sign}= {self.converted(value, REAL, node)};")
            return
        name = target.id
        before = self._of_Name(ast.Name(name, ast.Load())).type
        self.operands(node, node.op, before, value.type)
        kind = REAL if isinstance(node.op, ast.Div) else joined(before, value.type)
        if name in self._counting or (name in self.parameters and kind != before):
            self.refuse(node, f"{name} becomes of another kind")
        if name not in self.parameters:
            self.types[name] = kind
        self.emit(f"{local(name)} {sign}= {self.converted(value, kind, node)};")
