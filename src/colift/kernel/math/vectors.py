"""Steps of four numbers at a time, inside kernels: what a compiler does not find by itself in short columns."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

QUAD = 4
"""Numbers in one step. Columns are as long as a multiple of it; what is behind their end is zero."""


def eliminate(vector, count, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
    """Take columns ``one`` and ``two`` of an array, in the ratios (a, b) and (c, d), from its columns ``first`` and ``second``.

    Of each ``count`` numbers from that place on; compiled by Numba, whole quads.
    """
    for k in range(count):
        x, y = vector[one + k], vector[two + k]
        vector[first + k] = vector[first + k] - x * a - y * b
        vector[second + k] = vector[second + k] - x * c - y * d


def solve(vector, count, first, second, a, b, c):  # type: ignore[no-untyped-def]
    """Solve for ``count`` columns, or whole quads of them as above: ``first`` becomes x = a first, ``second`` c (second - b x)."""
    for k in range(count):
        vector[first + k] *= a
        vector[second + k] = (vector[second + k] - b * vector[first + k]) * c


def add_quad(target, at, source, begin, a):  # type: ignore[no-untyped-def]
    """Add four numbers of an array, from ``begin`` on, times a to four of another, or of the same."""
    for k in range(QUAD):
        target[at + k] += a * source[begin + k]


_four = ir.VectorType(ir.DoubleType(), QUAD)
_FUSED = ("contract",)


def _quad(context: Any, builder: Any, kind: Any, array: Any, place: Any) -> Any:
    """Where four numbers of an array stand."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [place], inbounds=True), _four.as_pointer())


def _spread(builder: Any, number: Any) -> Any:
    """Four times the same number."""
    nothing = ir.Constant(_four, ir.Undefined)
    one = builder.insert_element(nothing, number, ir.IntType(32)(0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), QUAD), [0] * QUAD)
    return builder.shuffle_vector(one, nothing, mask)


def _eliminate_code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    first, second, one, two = (
        _quad(context, builder, signature.args[0], args[0], place) for place in args[1:5]
    )
    a, b, c, d = (_spread(builder, number) for number in args[5:])
    x, y = builder.load(one, align=8), builder.load(two, align=8)
    for target, p, q in ((first, a, b), (second, c, d)):
        value = builder.load(target, align=8)
        value = builder.fsub(value, builder.fmul(x, p, flags=_FUSED), flags=_FUSED)
        value = builder.fsub(value, builder.fmul(y, q, flags=_FUSED), flags=_FUSED)
        builder.store(value, target, align=8)
    return context.get_dummy_value()


def _add_code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    target = _quad(context, builder, signature.args[0], args[0], args[1])
    source = builder.load(_quad(context, builder, signature.args[2], args[2], args[3]), align=8)
    product = builder.fmul(source, _spread(builder, args[4]), flags=_FUSED)
    value = builder.fadd(builder.load(target, align=8), product, flags=_FUSED)
    builder.store(value, target, align=8)
    return context.get_dummy_value()


def _solve_code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    first, second = (
        _quad(context, builder, signature.args[0], args[0], place) for place in args[1:3]
    )
    a, b, c = (_spread(builder, number) for number in args[3:])
    x = builder.fmul(builder.load(first, align=8), a, flags=_FUSED)
    builder.store(x, first, align=8)
    value = builder.load(second, align=8)
    value = builder.fsub(value, builder.fmul(x, b, flags=_FUSED), flags=_FUSED)
    builder.store(builder.fmul(value, c, flags=_FUSED), second, align=8)
    return context.get_dummy_value()


@intrinsic
def _eliminate(typingctx, vector, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
    return types.void(vector, first, second, one, two, a, b, c, d), _eliminate_code


@intrinsic
def _add(typingctx, target, at, source, begin, a):  # type: ignore[no-untyped-def]
    return types.void(target, at, source, begin, a), _add_code


@intrinsic
def _solve(typingctx, vector, first, second, a, b, c):  # type: ignore[no-untyped-def]
    return types.void(vector, first, second, a, b, c), _solve_code


_eliminate_quad: Any = _eliminate
_add_quad: Any = _add
_solve_quad: Any = _solve
_INSIDE: Any = {"forceinline": True, "error_model": "numpy"}


@overload(eliminate, jit_options=_INSIDE)
def _overload_eliminate(vector, count, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
    def quads(vector, count, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
        for k in range(0, count, QUAD):
            _eliminate_quad(vector, first + k, second + k, one + k, two + k, a, b, c, d)

    return quads


@overload(solve, jit_options=_INSIDE)
def _overload_solve(vector, count, first, second, a, b, c):  # type: ignore[no-untyped-def]
    def quads(vector, count, first, second, a, b, c):  # type: ignore[no-untyped-def]
        for k in range(0, count, QUAD):
            _solve_quad(vector, first + k, second + k, a, b, c)

    return quads


@overload(add_quad, inline="always")
def _overload_add(target, at, source, begin, a):  # type: ignore[no-untyped-def]
    return lambda target, at, source, begin, a: _add_quad(target, at, source, begin, a)
