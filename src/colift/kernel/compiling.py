"""Numba compiles a kernel in half the time.

Left out are what a helper would need only by itself (:class:`BodyCompiler`), and what Numba works out over and over while
it compiles one kernel, which changes nothing of the machine code (:func:`hurried`). Left out of the machine code is what would
count negative indices from the end (:func:`_from_the_start`).
"""

from __future__ import annotations

import gc
import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import binding as llvm
from llvmlite import ir as llvm_ir
from numba.core import base, codegen, event, ir, types
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock

_OPERATORS = {value for value in vars(operator).values() if callable(value)}
_NUMBERS = (types.Number, types.Boolean, types.Literal)


class _Body(codegen.JITCodeLibrary):
    """Code that is only ever linked with other code: optimised, and left at that.

    Machine code would not only take time: LLVM makes it in place, and what links the function would get what is left of it.
    """

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        # Where Numba will write what belongs to the function besides its code.
        places = (
            f'@"{each.name}" = common global i64 0\n'
            for each in self._final_module.global_variables
            if each.linkage == llvm.Linkage.common
        )
        self._codegen._add_module(llvm.parse_assembly("".join(places)))
        self._codegen._engine.finalize_object()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0  # there is none


class BodyCompiler(Compiler):
    """Numba's compiler, for functions that only compiled code calls and that become part of it."""

    def define_pipelines(self) -> Any:
        state = self.state
        state.library = _Body(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()  # type: ignore[no-untyped-call]


_depth = 0


@contextmanager
def hurried() -> Iterator[None]:
    """In this block Numba remembers the types of an operator, and which operators have no special form for a constant.

    It asks for both in each line, and for the second looks through all that it knows. Python does not look for garbage, of
    which there is little. Indices are places from the start.
    """
    global _depth
    with global_compiler_lock:
        if _depth:
            yield
            return
        collecting = gc.isenabled()
        gc.disable()
        _depth += 1
        kept = _Kept()
        try:
            kept.replace(types.BaseFunction, "get_call_type", _remembered)
            kept.replace(base.BaseContext, "get_function", _known_to_be_missing)
            kept.replace(ir.Inst, "_rec_list_vars", lambda _: _variables)
            with event.install_listener("numba:compile", kept):
                yield
        finally:
            _depth -= 1
            kept.restore()
            if collecting:
                gc.enable()


class _Kept(event.Listener):
    """Functions of Numba that others stand for, until they are restored."""

    def __init__(self) -> None:
        self._before: list[tuple[Any, str, Any]] = []
        self._compiles = False

    def replace(self, owner: Any, name: str, made: Callable[[Any], Any]) -> None:
        before = getattr(owner, name)
        self._before.append((owner, name, before))
        setattr(owner, name, made(before))

    def restore(self) -> None:
        for owner, name, before in reversed(self._before):
            setattr(owner, name, before)

    def on_start(self, event: Any) -> None:
        """Numba compiles, which loads more of it; what is in the cache needs none of that."""
        if not self._compiles:
            from numba.np import arrayobj

            self._compiles = True
            self.replace(arrayobj, "fix_integer_index", _from_the_start)

    def on_end(self, event: Any) -> None:
        """Others may compile yet."""


def _remembered(ask: Callable[..., Any]) -> Callable[..., Any]:
    """``Function.get_call_type``: the signature of an operator for given types, which is the same for each line."""
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not _of_numbers(self, args):
            return ask(self, context, args, kws)
        key = self.typing_key, context, args
        if key not in known:
            known[key] = ask(self, context, args, kws)
        return known[key]

    return get_call_type


def _known_to_be_missing(ask: Callable[..., Any]) -> Callable[..., Any]:
    """``BaseContext.get_function``: what an operator with a constant was not found for is not looked for again."""
    missing: set[Any] = set()

    def get_function(self: Any, fn: Any, sig: Any, _firstcall: bool = True) -> Any:
        args = sig.args
        if not (_firstcall and _of_numbers(fn, args)):
            return ask(self, fn, sig, _firstcall)
        key = fn.typing_key, args, sig.return_type
        if key in missing:
            raise NotImplementedError
        try:
            return ask(self, fn, sig)
        except NotImplementedError:
            missing.add(key)
            raise

    return get_function


_OURS = "_ZN6colift"
"""How the names of colift's own functions begin in machine code."""


def _from_the_start(fix: Callable[..., Any]) -> Callable[..., Any]:
    """``fix_integer_index`` for colift's own functions: an index that is not a constant is never negative.

    To allow for it takes three instructions at every use of an array, a third of what small matrices need. Whoever writes
    parts elsewhere keeps Python's rule.
    """

    def fix_integer_index(context: Any, builder: Any, kind: Any, index: Any, size: Any) -> Any:
        ours = builder.function.name.startswith(_OURS)
        if not ours or isinstance(index, llvm_ir.Constant):
            return fix(context, builder, kind, index, size)
        return context.cast(builder, index, kind, types.intp if kind.signed else types.uintp)

    return fix_integer_index


def _of_numbers(function: Any, args: Any) -> bool:
    return (
        isinstance(function, types.Function)
        and function.typing_key in _OPERATORS
        and all(isinstance(each, _NUMBERS) for each in args)
    )


_NO_VARIABLE = frozenset({str, int, float, bool, type(None), ir.Loc})


def _variables(self: Any, value: Any) -> list[Any]:
    """``Inst._rec_list_vars``, for which the commonest types come first."""
    if isinstance(value, dict):
        value = value.values()
    elif isinstance(value, ir.Var):
        return [value]
    elif isinstance(value, ir.Inst):
        return value.list_vars()  # type: ignore[no-any-return]
    elif not isinstance(value, list | tuple):
        return []
    found: list[Any] = []
    for each in value:
        kind = type(each)
        if kind is ir.Var:
            found.append(each)
        elif kind not in _NO_VARIABLE:
            found += _variables(self, each)
    return found
