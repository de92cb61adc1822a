"""Signals go to compiled code by reference: of the tuples that a port's kernels see and write, only their place is passed.

A kernel looks up what it uses. By value each call would hand over every array of the port, which costs more than small
kernels take, and each signal that is added to a port would cost all of its kernels more.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_cast,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.numpy_support import as_dtype


def named_signals(name: str, fields: Iterable[str], module: str) -> Any:
    """A class of named tuples of arrays, found again in ``module`` under its name, as the cache of kernels needs it."""
    return type(name, (_Place, namedtuple(name, tuple(fields))), {"__module__": module})


class Signals(types.Type):
    """Numba's type of one class of named tuples of arrays, which stand where they are for as long as the code runs."""

    def __init__(self, made: Any, each: Iterable[Any]) -> None:
        self.made, self.each = made, tuple(each)
        super().__init__(f"{made.__module__}.{made.__name__}")

    @property
    def value(self) -> Any:
        """Type of the same tuple by value."""
        return types.BaseTuple.from_types(self.each, self.made)

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """A tuple of this class that compiled code has made is one."""
        return Conversion.safe if getattr(other, "instance_class", None) is self.made else None


class _Place:
    """Of a tuple of arrays where compiled code finds them."""

    _kinds: tuple[tuple[Any, int], ...]

    @cached_property
    def _words(self) -> Any:
        """What Numba keeps of each array: nobody who counts references, length, size of an item, place, shape and strides."""
        words: list[int] = []
        for name, array, (dtype, dimensions) in zip(self._fields, self, self._kinds, strict=True):  # type: ignore[attr-defined, call-overload]
            if not (
                isinstance(array, np.ndarray)
                and array.dtype == dtype
                and array.ndim == dimensions
                and array.flags.c_contiguous
            ):
                raise TypeError(
                    f"{type(self).__name__}.{name}: {dimensions} dimensions of {dtype}, contiguous, are wanted"
                )
            place = array.__array_interface__["data"][0]
            words += (0, 0, array.size, array.itemsize, place, *array.shape, *array.strides)
        return np.array(words, np.intp)

    @cached_property
    def _place(self) -> int:
        return int(self._words.__array_interface__["data"][0])

    def __getstate__(self) -> None:
        """A copy has arrays of its own, and so a place of its own."""


def signals_type(made: Any, each: Iterable[Any]) -> Signals:
    """The type of a class of named tuples whose fields are arrays of these types; that is what Numba takes each for from now on."""
    found = Signals(made, each)
    made._kinds = tuple((as_dtype(kind.dtype), kind.ndim) for kind in found.each)

    def typeof(value: Any, context: Any) -> Any:
        return found

    register: Any = typeof_impl.register
    register(made)(typeof)
    return found


@register_model(Signals)
class _Model(models.PrimitiveModel):
    """Where the tuple stands."""

    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(  # type: ignore[no-untyped-call]
            dmm, fe_type, dmm.lookup(fe_type.value).get_value_type().as_pointer()
        )

    def from_argument(self, builder: Any, value: Any) -> Any:
        # Nobody writes there while a kernel runs: what it looks up in a loop, it may look up before.
        if isinstance(value, ir.Argument):
            value.add_attribute("noalias")
            value.add_attribute("nonnull")
        return value


def _put(context: Any, builder: Any, signals: Signals, value: Any) -> Any:
    """Let a tuple by value stand somewhere."""
    place = cgutils.alloca_once(builder, context.get_value_type(signals.value))
    for i in range(len(signals.each)):
        builder.store(builder.extract_value(value, i), cgutils.gep_inbounds(builder, place, 0, i))
    return place


@unbox(Signals)  # type: ignore[untyped-decorator]
def _unbox(typ: Signals, obj: Any, c: Any) -> Any:
    # The tuple says where its words stand: to take each array out of its Python object here would be most of a small kernel's code.
    # They are copied to where no other code can write, so that what is looked up in a loop is looked up before.
    model = c.context.get_value_type(typ.value)
    place = cgutils.alloca_once(c.builder, model)
    number = c.pyapi.object_getattr_string(obj, "_place")
    missing = cgutils.is_null(c.builder, number)
    with c.builder.if_then(c.builder.not_(missing), likely=True):
        words = c.builder.inttoptr(c.pyapi.long_as_ulonglong(number), model.as_pointer())
        size = c.context.get_constant(types.intp, c.context.get_abi_sizeof(model))
        cgutils.raw_memcpy(c.builder, place, words, size, 1)
        c.pyapi.decref(number)
    return NativeValue(place, is_error=missing)


@lower_cast(types.BaseNamedTuple, Signals)  # type: ignore[untyped-decorator]
def _cast(context: Any, builder: Any, fromty: Any, toty: Signals, value: Any) -> Any:
    return _put(context, builder, toty, context.cast(builder, value, fromty, toty.value))


@infer_getattr
class _Fields(AttributeTemplate):
    key = Signals

    def generic_resolve(self, signals: Any, attr: str) -> Any:  # type: ignore[override]
        if attr in signals.made._fields:
            return signals.each[signals.made._fields.index(attr)]
        return None


@lower_getattr_generic(Signals)  # type: ignore[untyped-decorator]
def _look_up(context: Any, builder: Any, typ: Signals, place: Any, attr: str) -> Any:
    i = typ.made._fields.index(attr)
    array = context.make_array(typ.each[i])(
        context, builder, builder.load(cgutils.gep_inbounds(builder, place, 0, i))
    )
    # Who holds the tuple keeps the arrays: here nobody counts who refers to them.
    for owner in ("meminfo", "parent"):
        nobody = cgutils.get_null_value(getattr(array, owner).type)
        setattr(array, owner, nobody)
    return array._getvalue()
