"""Python's expressions in C, with the type of each."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NoReturn

from colift.deploy.c.places import Places
from colift.deploy.c.source import Source
from colift.deploy.c.types import (
    BOOL,
    INT,
    NOTHING,
    NUMBERS,
    REAL,
    Array,
    Function,
    Tuple,
    Type,
    bare,
    joined,
    size,
)

if TYPE_CHECKING:
    from colift.deploy.c.program import Program
    from colift.deploy.c.translate import Translation

UNKNOWN: Any = object()
"""In place of a value that is known only when the code runs."""

# How tightly C's operators bind.
ATOM, UNARY, PRODUCT, SUM, SHIFT, ORDER, EQUAL, BITS, ALL, ANY, CHOICE = range(11, 0, -1)

BINARY: dict[type, tuple[str, int]] = {
    ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT),
    ast.BitOr: ("|", BITS), ast.BitAnd: ("&", BITS), ast.LShift: ("<<", SHIFT),
}  # fmt: skip
_COMPARE: dict[type, str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
_MATH = {
    math.sqrt: "sqrt", math.sin: "sin", math.cos: "cos", math.tan: "tan", math.acos: "acos", math.atan: "atan",
    math.atan2: "atan2", math.hypot: "hypot", math.exp: "exp", math.copysign: "copysign", abs: "fabs",
}  # fmt: skip
_TESTS = {math.isfinite: "isfinite", math.isnan: "isnan"}
_RESERVED = """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool
    true false I NULL sqrt sin cos tan acos atan atan2 hypot exp copysign fabs abs rint fmod
"""
_OPEN = "which comes first, the call or the look at an array, is open in C"


def local(name: str) -> str:
    """Name of a parameter or variable in C."""
    return f"{name}_" if name in _RESERVED.split() else name


@dataclass(frozen=True)
class Value:
    """A piece of C and what it is."""

    code: str
    type: Type
    binds: int = ATOM
    known: Any = field(default=UNKNOWN, compare=False)
    """What it is, where that is known before the code runs."""
    parts: tuple[Value, ...] | None = None
    """Of a tuple that stands nowhere yet."""
    pointer: bool = False
    """The code says where the tuple stands."""
    reads: bool = False
    """It depends on what is in an array."""
    acts: bool = False
    """It calls a function that writes to an array."""

    def within(self, binds: int) -> str:
        """The code, in parentheses where an operator that binds so tightly would take it apart."""
        return self.code if self.binds >= binds else f"({self.code})"


class Expressions:
    """What a function's expressions are in C.

    Attributes
    ----------
    parameters, types : dict
        What each parameter is, and the type of each variable.
    written : set of str
        Parameters, or fields of them, into which the function writes.
    lengths : list of str
        Parameters whose first dimension it must be told.
    calls : list of Translation
        What it calls.
    lines : list of str
        Its body.

    """

    program: Program
    source: Source
    places: Places
    outer: Places
    """Those of the function itself where lines of a helper become its own."""
    parameters: dict[str, Value]
    types: dict[str, Type]
    written: set[str]
    lengths: list[str]
    calls: list[Translation]
    lines: list[str]
    final: bool
    _indent = 1
    _fresh = 0

    def refuse(self, node: ast.AST, why: str) -> NoReturn:
        """Say what cannot be translated, and where."""
        raise self.source.refuse(node, why)

    def emit(self, line: str) -> None:
        """Write a line of the body."""
        self.lines.append("    " * self._indent + line)

    def unused(self, name: str) -> str:
        """A name that the function does not use itself: the one that is asked for, or one like it."""
        while name in self.outer.names:
            name += "_"
        return name

    def declaration(self, kind: Type, name: str, *, const: bool = False) -> str:
        """Of a variable."""
        if isinstance(kind, Array):
            const = self.is_const(kind)
        mark = "const " if const else ""
        star = " *" if isinstance(kind, Array) else " "
        return f"{mark}{self.program.spelled(kind)}{star}{local(name)}"

    def is_const(self, kind: Array) -> bool:
        """Whether nothing is written to such an array."""
        return kind.const or bool(kind.roots - self.written)

    def write_to(self, array: Array, node: ast.AST) -> None:
        """Note that something is written to an array."""
        if array.const:
            self.refuse(node, "writes to what it only sees")
        self.written |= array.roots

    def ordered(self, values: Sequence[Value], node: ast.AST) -> None:
        """Refuse what C may do in another order than Python."""
        acting = [each for each in values if each.acts]
        if acting and (len(acting) > 1 or any(each.reads for each in values if not each.acts)):
            self.refuse(node, _OPEN)

    def converted(self, value: Value, kind: Type, node: ast.AST) -> str:
        """The code of a value for a place of this type."""
        if isinstance(kind, Tuple) and value.parts is not None:
            self.ordered(value.parts, node)
            for part in value.parts:
                if isinstance(part.type, Array) and not part.type.const:
                    self.written |= part.type.roots  # through this tuple it may be written to
            codes = [
                self.converted(part, each, node)
                for part, each in zip(value.parts, kind.each, strict=True)
                if each != NOTHING
            ]
            counted = self.program.counted(kind)
            if counted is not None:  # how many drones there are stands before the fields
                length = value.parts[kind.names().index(counted)].type.length
                codes.insert(0, self.length(length, node).code)
            begin, end = ("{{", "}}") if kind.uniform else ("{", "}")
            return f"({self.program.spelled(kind)}){begin}{', '.join(codes)}{end}"
        return self.real(value).code if kind == REAL else value.code

    def real(self, value: Value) -> Value:
        """A number as one with a fraction."""
        if value.type != INT:
            return value
        if value.code.lstrip("-").isdigit():
            return replace(value, code=self.program.number(float(value.code)), type=REAL)
        if self.program.single:
            return replace(value, code=f"(float){value.within(UNARY)}", binds=UNARY, type=REAL)
        return replace(value, type=REAL)

    def kept(self, value: Value, node: ast.AST) -> Value:
        """The same in a variable of its own."""
        self._fresh += 1
        name = self.unused(f"kept{self._fresh}")
        code = self.converted(value, value.type, node)
        self.emit(f"{self.declaration(value.type, name, const=True)} = {code};")
        return Value(name, value.type, known=value.known)

    # Names and numbers

    def value(self, node: ast.expr) -> Value:
        """An expression in C."""
        owner = node
        while isinstance(owner, ast.Attribute):
            owner = owner.value
        if isinstance(owner, ast.Name) and owner.id not in self.places.names:
            try:
                return self.constant(node, self.source.known(node))
            except LookupError:
                self.refuse(node, "no such name")
        found = getattr(self, f"_of_{type(node).__name__}", None)
        if found is None:
            self.refuse(node, "no such expression in C")
        value = found(node)
        assert isinstance(value, Value)
        return value

    def lazily(self, node: ast.expr) -> Value:
        """An expression at which Python may never look, so that nothing of it may stand in lines before."""
        begin = len(self.lines)
        value = self.value(node)
        if len(self.lines) > begin:
            self.refuse(node, "needs a variable of its own, where nobody may look at it")
        return value

    def constant(self, node: ast.expr, known: Any) -> Value:
        """What a name of the module stands for."""
        if isinstance(known, bool):
            return self.literal(known, node)
        if isinstance(known, int | float):
            kind = INT if isinstance(known, int) else REAL
            return Value(self.program.constant(self.source, node, known), kind, known=known)
        if isinstance(known, tuple) and all(isinstance(each, int | float) for each in known):
            parts = tuple(self.literal(each, node) for each in known)
            return Value("", Tuple(tuple(part.type for part in parts)), known=known, parts=parts)
        return Value("", Function(known), known=known)

    def literal(self, number: float, node: ast.AST) -> Value:
        """A number."""
        if isinstance(number, bool):
            return Value("true" if number else "false", BOOL, known=number)
        if isinstance(number, int):
            if abs(number) > 0x7FFFFFFF:
                self.refuse(node, "an integer of more than 32 bits")
            return Value(str(int(number)), INT, ATOM if number >= 0 else UNARY, known=int(number))
        code = self.program.number(number)
        return Value(code, REAL, UNARY if code.startswith("-") else ATOM, known=number)

    def _of_Constant(self, node: ast.Constant) -> Value:
        if not isinstance(node.value, int | float):
            self.refuse(node, "no number")
        return self.literal(node.value, node)

    def _of_Name(self, node: ast.Name) -> Value:
        if node.id in self.parameters:
            return self.parameters[node.id]
        if node.id not in self.types:
            if self.final:
                self.refuse(node, f"{node.id} has no value")
            return Value(local(node.id), REAL)
        return Value(local(node.id), self.types[node.id])

    def _of_Attribute(self, node: ast.Attribute) -> Value:
        owner = self.value(node.value)
        fields = getattr(getattr(owner.type, "made", None), "_fields", ())
        if node.attr not in fields:
            self.refuse(node, "no such attribute in C")
        return self.part(owner, fields.index(node.attr))

    # Tuples

    def part(self, value: Value, k: int) -> Value:
        """One of the values of a tuple."""
        if value.parts is not None:
            return value.parts[k]
        kind, of = value.type.each[k], "->" if value.pointer else "."
        name = f"at[{k}]" if value.type.uniform else value.type.names()[k]
        return Value(f"{value.code}{of}{name}", kind)

    def _of_Tuple(self, node: ast.Tuple) -> Value:
        return self.gathered(self._listed(node.elts))

    def _listed(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Values one after the other, those of a starred tuple too."""
        found: list[Value] = []
        for each in nodes:
            if isinstance(each, ast.Starred):
                whole = self.kept(self.value(each.value), each)
                found += [self.part(whole, k) for k in range(len(whole.type.each))]
            else:
                found.append(self.value(each))
        return found

    def gathered(self, parts: Sequence[Value], made: Any = None) -> Value:
        """A tuple of these values."""
        kind = Tuple(tuple(part.type for part in parts), made)
        reads, acts = any(part.reads for part in parts), any(part.acts for part in parts)
        return Value("", kind, parts=tuple(parts), reads=reads, acts=acts)

    def _item(self, node: ast.Subscript, owner: Value) -> Value:
        kind = owner.type
        if isinstance(node.slice, ast.Slice):
            low, high = (
                None if each is None else self.value(each).known
                for each in (node.slice.lower, node.slice.upper)
            )
            return self.gathered(
                [self.part(owner, k) for k in range(len(kind.each))[slice(low, high)]]
            )
        place = self.value(node.slice)
        if isinstance(place.known, int):
            return self.part(owner, place.known)
        if place.type != INT or not kind.uniform:
            self.refuse(node, "a computed place in values of different kinds")
        if owner.known is not UNKNOWN:
            name = self.program.table(self.source, node.value, owner.known)
            return Value(f"{name}[{place.code}]", kind.each[0])
        if owner.parts is not None:
            owner = self.kept(owner, node)
        return Value(f"{owner.code}.at[{place.code}]", kind.each[0], reads=place.reads)

    # Operators

    def operands(self, node: ast.AST, operator: ast.operator, *kinds: Type) -> None:
        """Refuse an operator for what it is not."""
        whole = isinstance(operator, ast.BitOr | ast.BitAnd | ast.LShift)
        if any(kind not in (REAL, INT) or (whole and kind != INT) for kind in kinds):
            self.refuse(node, "this operator is for other numbers")

    def _of_BinOp(self, node: ast.BinOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        self.operands(node, node.op, left.type, right.type)
        self.ordered((left, right), node)
        if isinstance(node.op, ast.Pow):
            return self._power(node, left, right)
        flags: Any = {"reads": left.reads or right.reads, "acts": left.acts or right.acts}
        kind = INT if left.type == right.type == INT else REAL
        if isinstance(node.op, ast.Mod | ast.FloorDiv):
            name = "modulo" if isinstance(node.op, ast.Mod) else "whole"
            if name == "whole" and kind == REAL:
                self.refuse(node, "this operator is for other numbers")
            helper = self.program.helper(name, kind)
            a, b = (self.converted(each, kind, node) for each in (left, right))
            return Value(f"{helper}({a}, {b})", kind, **flags)
        if type(node.op) not in BINARY:
            self.refuse(node, "no such operator in C")
        sign, binds = BINARY[type(node.op)]
        if isinstance(node.op, ast.Div) and kind == INT:
            code = f"({self.program.real}){left.within(UNARY)}"
            left, kind = Value(code, REAL, UNARY), REAL
        known = UNKNOWN
        if kind == REAL:
            left, right = self.real(left), self.real(right)
        elif (simple := _simplified(sign, left, right)) is not None:
            return simple
        elif UNKNOWN not in (left.known, right.known):
            known = _folded(sign, left.known, right.known)
        tight = ATOM if binds in (BITS, SHIFT) else binds
        code = f"{left.within(tight)} {sign} {right.within(max(tight, binds + 1))}"
        return Value(code, kind, binds, known=known, **flags)

    def _power(self, node: ast.BinOp, base: Value, exponent: Value) -> Value:
        """As products, in the order in which Numba multiplies."""
        count = exponent.known
        if not isinstance(count, int) or not 1 <= count <= 16:
            self.refuse(node, "only powers with a small positive integer as exponent")
        if base.code.isidentifier():
            return replace(base, code=power(base.code, count), binds=PRODUCT, known=UNKNOWN)
        code = f"{self.program.helper(f'power{count}', base.type)}({base.code})"
        return replace(base, code=code, binds=ATOM, known=UNKNOWN)

    def _of_UnaryOp(self, node: ast.UnaryOp) -> Value:
        value = self.value(node.operand)
        if isinstance(node.op, ast.Not):
            code = f"!{self.condition(value, node).within(UNARY)}"
            return replace(value, code=code, type=BOOL, binds=UNARY, known=UNKNOWN)
        if not isinstance(node.op, ast.USub) or value.type not in (REAL, INT):
            self.refuse(node, "no such operator in C")
        known = UNKNOWN if value.known is UNKNOWN else -value.known
        inner = value.within(UNARY)
        gap = " " if inner.startswith("-") else ""
        return replace(value, code=f"-{gap}{inner}", binds=UNARY, known=known)

    def condition(self, value: Value, node: ast.AST) -> Value:
        """A value as a condition."""
        if value.type not in NUMBERS:
            self.refuse(node, "no condition")
        if value.type == BOOL:
            return value
        zero = "0" if value.type == INT else self.program.number(0.0)
        return replace(value, code=f"{value.within(SHIFT)} != {zero}", binds=EQUAL, type=BOOL)

    def truth(self, node: ast.expr) -> str:
        """The code of a condition that may never be looked at."""
        return self.condition(self.lazily(node), node).code

    def _of_BoolOp(self, node: ast.BoolOp) -> Value:
        values = [self.value(node.values[0]), *map(self.lazily, node.values[1:])]
        if any(each.type != BOOL for each in values):
            self.refuse(node, "and, or as something else than a condition")
        sign, binds = ("&&", ALL) if isinstance(node.op, ast.And) else ("||", ANY)
        code = f" {sign} ".join(each.within(EQUAL) for each in values)
        reads, acts = any(v.reads for v in values), any(v.acts for v in values)
        return Value(code, BOOL, binds, reads=reads, acts=acts)

    def _of_Compare(self, node: ast.Compare) -> Value:
        if len(node.ops) == 1 and isinstance(node.ops[0], ast.In | ast.NotIn):
            return self._in(node)
        values = [self.value(each) for each in (node.left, *node.comparators)]
        self.ordered(values, node)
        if any(each.type not in NUMBERS for each in values):
            self.refuse(node, "compares what is no number")
        if any(each.acts for each in values[1:-1]):
            self.refuse(node, "would be called twice")
        parts = []
        for left, operator, right in zip(values, node.ops, values[1:], strict=False):
            if type(operator) not in _COMPARE:
                self.refuse(node, "no such comparison in C")
            if REAL in (left.type, right.type):
                left, right = self.real(left), self.real(right)
            parts.append(f"{left.within(SHIFT)} {_COMPARE[type(operator)]} {right.within(SHIFT)}")
        reads, acts = any(v.reads for v in values), any(v.acts for v in values)
        binds = ALL if len(parts) > 1 else EQUAL
        return Value(" && ".join(parts), BOOL, binds, reads=reads, acts=acts)

    def _in(self, node: ast.Compare) -> Value:
        value, among = self.value(node.left), self.value(node.comparators[0])
        if value.acts or among.parts is None:
            self.refuse(node, "only in a tuple that is written out")
        sign, link = ("==", "||") if isinstance(node.ops[0], ast.In) else ("!=", "&&")
        parts = [replace(e, code=self.converted(e, value.type, node)) for e in among.parts]
        code = f" {link} ".join(f"{value.within(SHIFT)} {sign} {e.within(SHIFT)}" for e in parts)
        return Value(code, BOOL, ANY if link == "||" else ALL, reads=value.reads)

    def _of_IfExp(self, node: ast.IfExp) -> Value:
        test = self.condition(self.value(node.test), node.test)
        values = self.lazily(node.body), self.lazily(node.orelse)
        kind = joined(values[0].type, values[1].type)
        if kind is None:
            self.refuse(node, "now of one kind, now of another")
        all_ = (test, *values)
        reads, acts = any(each.reads for each in all_), any(each.acts for each in all_)
        one, other = (
            replace(each, code=self.converted(each, kind, node)).within(CHOICE + 1)
            for each in values
        )
        return Value(f"{test.within(ALL)} ? {one} : {other}", kind, CHOICE, reads=reads, acts=acts)

    # Arrays

    def _of_Subscript(self, node: ast.Subscript) -> Value:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            return self._dimension(node)
        owner = self.value(node.value)
        if isinstance(owner.type, Tuple):
            return self._item(node, owner)
        if not isinstance(owner.type, Array):
            self.refuse(node, "looks up in what is no array")
        places = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        dimensions = _dimensions(owner.type)
        if len(places) > len(dimensions):
            self.refuse(node, "more places than dimensions")
        offsets: list[str] = []
        left = dimensions[len(places) :]
        for place, (dimension, stride) in reversed([*zip(places, dimensions, strict=False)]):
            if isinstance(place, ast.Slice):
                begin, length = self._span(place, dimension, node)
                left.insert(0, (length, stride))
            else:
                begin = self.value(place)
            if begin.type != INT or begin.acts:
                self.refuse(node, "a place that is no integer")
            if begin.code.startswith("-"):
                self.refuse(node, "a place that is counted from the end")
            if begin.code != "0":
                offsets.insert(0, _scaled(begin, stride))
        return self._there(node, owner, " + ".join(offsets), left)

    def _there(self, node: ast.Subscript, owner: Value, where: str, left: list[Any]) -> Value:
        """What is there: a number, or a part of the array."""
        if not left:
            if isinstance(node.ctx, ast.Store):
                self.write_to(owner.type, node)
            return Value(f"{owner.within(ATOM)}[{where or '0'}]", REAL, reads=True)
        (length, stride), inner = left[0], left[1:]
        sizes = tuple(each for each, _ in inner)
        if not all(isinstance(each, int) for each in sizes):
            self.refuse(node, "dimensions that are known only when it runs")
        if [each for _, each in inner] != [size(sizes[k + 1 :]) for k in range(len(sizes))]:
            self.refuse(node, "a part whose rows have gaps")
        kind = Array(sizes, stride, owner.type.const, length, owner.type.roots)
        if not where:
            return replace(owner, type=kind)
        return Value(f"{owner.within(SUM)} + {where}", kind, SUM)

    def _span(self, place: ast.Slice, dimension: Any, node: ast.AST) -> tuple[Value, Any]:
        """Where a part begins, and how long it is."""
        if place.step is not None:
            self.refuse(node, "a part with a step")
        begin = self.value(place.lower) if place.lower else self.literal(0, node)
        if place.upper is not None:
            end = self.value(place.upper)
            if isinstance(begin.known, int) and isinstance(end.known, int):
                return begin, end.known - begin.known
            length = end.code if begin.known == 0 else f"{end.code} - {begin.within(PRODUCT)}"
            upper = place.upper
            if (
                place.lower
                and isinstance(upper, ast.BinOp)
                and isinstance(upper.op, ast.Add)
                and ast.dump(upper.left) == ast.dump(place.lower)
            ):  # begin : begin + length
                told = self.value(upper.right)
                if isinstance(told.known, int):
                    return begin, told.known
                length = told.code
            return begin, length if self._stays(length) else None
        if isinstance(dimension, int) and isinstance(begin.known, int):
            return begin, dimension - begin.known
        if begin.known == 0 or dimension is None:
            return begin, dimension
        return begin, f"{dimension} - {begin.within(PRODUCT)}"

    def _stays(self, code: str) -> bool:
        """Whether the variables in a piece of C keep their values."""
        return all(self.outer.stored_once(w) for w in re.findall(r"\w+", code) if w in self.types)

    def _dimension(self, node: ast.Subscript) -> Value:
        assert isinstance(node.value, ast.Attribute)
        array, k = self.value(node.value.value), self.value(node.slice).known
        if not isinstance(array.type, Array) or not isinstance(k, int):
            self.refuse(node, "no array, or no number of a dimension")
        return self.length(_dimensions(array.type)[k][0], node)

    def length(self, found: int | str | None, node: ast.AST) -> Value:
        """A dimension, for which the function may have to be told another."""
        if found is None:
            self.refuse(node, "a length that nobody told")
        if isinstance(found, int):
            return Value(str(found), INT, known=found)
        for name in self.source.parameters:
            if f"{name}_length" in found.split() and name not in self.lengths:
                self.lengths.append(name)
        return Value(found, INT, SUM if " " in found else ATOM)

    # Calls

    def _of_Call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            return self._reshape(node, node.func.value)
        function = self.value(node.func)
        if not isinstance(function.type, Function):
            self.refuse(node, "calls what is no function")
        given = self._listed(node.args)
        made = function.type.made
        if isinstance(made, type) and hasattr(made, "_fields"):
            by_name = {each.arg: self.value(each.value) for each in node.keywords}
            return self.gathered([*given, *(by_name[f] for f in made._fields[len(given) :])], made)
        if node.keywords:
            self.refuse(node, "arguments by name")
        self.ordered(given, node)
        if hasattr(made, "py_func"):
            if made.targetoptions.get("inline") == "always":
                return self._spliced(made.py_func, given)
            return self._called(node, made.py_func, given)
        if made in self.program.as_they_are:
            return self._called(node, made, given)
        return self._built_in(node, made, given)

    def _built_in(self, node: ast.Call, made: Any, given: list[Value]) -> Value:
        flags: Any = {"reads": any(v.reads for v in given), "acts": any(v.acts for v in given)}
        kinds = [each.type for each in given]
        if any(kind not in (REAL, INT) for kind in kinds):
            self.refuse(node, "a function of other numbers")
        first, program = given[0], self.program
        if made in (min, max):
            kind = INT if set(kinds) == {INT} else REAL
            name, code = program.helper(made.__name__, kind), self.converted(first, kind, node)
            for each in given[1:]:
                code = f"{name}({code}, {self.converted(each, kind, node)})"
            return Value(code, kind, **flags)
        if made in (int, float):
            kind = INT if made is int else REAL
            if kinds == [kind]:
                return first
            name = "int" if made is int else program.real
            return Value(f"({name}){first.within(UNARY)}", kind, UNARY, **flags)
        if made is round and kinds == [REAL]:
            return Value(f"(int){program.math('rint')}({first.code})", INT, UNARY, **flags)
        if made is abs and kinds == [INT]:
            return Value(f"abs({first.code})", INT, **flags)
        if made in _TESTS:
            return Value(f"{_TESTS[made]}({self.real(first).code})", BOOL, **flags)
        if made not in _MATH:
            self.refuse(node, "no such function in C")
        inside = ", ".join(self.real(each).code for each in given)
        return Value(f"{program.math(_MATH[made])}({inside})", REAL, **flags)

    def _reshape(self, node: ast.Call, array: ast.expr) -> Value:
        owner, given = self.value(array), [self.value(each) for each in node.args]
        sizes = tuple(each.known for each in given[1:])
        if not isinstance(owner.type, Array) or owner.type.stride != size(owner.type.inner):
            self.refuse(node, "another shape of what has gaps")
        if any(not isinstance(each, int) for each in sizes):
            self.refuse(node, "dimensions that are known only when it runs")
        return replace(
            owner,
            type=replace(owner.type, inner=sizes, stride=size(sizes), length=given[0].code),
        )

    def _spliced(self, python: Any, given: list[Value]) -> Value:
        """What a helper returns whose lines become the caller's: they only name parts of tuples."""
        before = self.source, self.places, self.parameters
        self.source = Source(python)
        self.places = Places(self.source)
        self.parameters = dict(zip(self.source.parameters, given, strict=True))
        try:
            *lines, last = self.source.body
            for line in lines:
                if not isinstance(line, ast.Assign) or not isinstance(line.targets[0], ast.Tuple):
                    self.refuse(line, "more than names for the parts of a tuple")
                whole = self.value(line.value)
                for k, target in enumerate(line.targets[0].elts):
                    assert isinstance(target, ast.Name)
                    self.parameters[target.id] = self.part(whole, k)
            if not isinstance(last, ast.Return) or last.value is None:
                self.refuse(last, "does not return")
            return self.value(last.value)
        finally:
            self.source, self.places, self.parameters = before

    def _called(self, node: ast.Call, python: Any, given: list[Value]) -> Value:
        found = self.program.translation(python, [bare(each.type) for each in given])
        if found not in self.calls:
            self.calls.append(found)
        codes = [
            self._argument(found, name, each, node)
            for name, each in zip(found.source.parameters, given, strict=True)
            if not isinstance(each.type, Function)
        ]
        for name in found.lengths:
            length = given[found.source.parameters.index(name)].type.length
            codes.append(self.length(length, node).code)
        reads = any(each.reads or isinstance(each.type, Array | Tuple) for each in given)
        acts = bool(found.written) or any(each.acts for each in given)
        kind = REAL if found.result is None else found.result
        return Value(f"{found.name}({', '.join(codes)})", kind, reads=reads, acts=acts)

    def _argument(self, found: Translation, name: str, given: Value, node: ast.AST) -> str:
        kind = found.parameters[name].type
        if isinstance(kind, Array) and name in found.written:
            self.write_to(given.type, node)
        if not isinstance(kind, Tuple) or kind.made is None:
            return self.converted(given, kind, node)
        for of, each in zip(kind.made._fields, given.type.each, strict=True):
            if f"{name}.{of}" in found.written:
                self.write_to(each, node)
        return given.code if given.pointer else f"&{self.converted(given, given.type, node)}"


def _dimensions(array: Array) -> list[tuple[Any, int]]:
    """Of an array its dimensions, each with the way from one to the next."""
    inner = array.inner
    strides = (array.stride, *(size(inner[k + 1 :]) for k in range(len(inner))))
    return [*zip((array.length, *inner), strides, strict=True)]


def _scaled(place: Value, stride: int) -> str:
    return place.within(SUM) if stride == 1 else f"{stride} * {place.within(UNARY)}"


def _simplified(sign: str, left: Value, right: Value) -> Value | None:
    """Of whole numbers what adds nothing left out."""
    if sign == "+" and left.code == "0":
        return right
    if sign in "+-" and right.code == "0":
        return left
    if sign == "*" and "0" in (left.code, right.code):
        return Value("0", INT, known=0)
    if sign == "*" and "1" in (left.code, right.code):
        return right if left.code == "1" else left
    return None


def _folded(sign: str, a: int, b: int) -> Any:
    made = {"+": a + b, "-": a - b, "*": a * b, "|": a | b, "&": a & b}
    return made.get(sign, UNKNOWN)


def power(name: str, count: int) -> str:
    """``name ** count`` in the order in which Numba multiplies: squares of squares, of which the exponent picks some."""
    found, square = [], name
    while count:
        if count & 1:
            found.append(square)
        count >>= 1
        square = f"{_grouped(square)} * {_grouped(square)}"
    return " * ".join(map(_grouped, found)) if len(found) > 1 else found[0]


def _grouped(code: str) -> str:
    return f"({code})" if " " in code else code
