"""Steps of four numbers at a time, inside kernels: what a compiler does not find by itself in short columns."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from colift.kernel.jit import inline

QUAD = 4
"""Numbers in one step. Columns are as long as a multiple of it; what is behind their end is zero."""


def eliminate_quad(vector, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
    """Take columns ``one`` and ``two`` of an array, in the ratios (a, b) and (c, d), from its columns ``first`` and ``second``.

    Of each the four numbers from that place on.
    """
    for k in range(QUAD):
        x, y = vector[one + k], vector[two + k]
        vector[first + k] -= x * a + y * b
        vector[second + k] -= x * c + y * d


_four = ir.VectorType(ir.DoubleType(), QUAD)


def _code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, args[0])

    def at(place: Any) -> Any:
        begin = builder.gep(array.data, [place], inbounds=True)
        return builder.bitcast(begin, _four.as_pointer())

    def spread(number: Any) -> Any:
        one = builder.insert_element(ir.Constant(_four, ir.Undefined), number, ir.IntType(32)(0))
        mask = ir.Constant(ir.VectorType(ir.IntType(32), QUAD), [0] * QUAD)
        return builder.shuffle_vector(one, ir.Constant(_four, ir.Undefined), mask)

    fused = ("contract",)
    first, second, one, two = map(at, args[1:5])
    a, b, c, d = map(spread, args[5:])
    x, y = builder.load(one, align=8), builder.load(two, align=8)
    for target, p, q in ((first, a, b), (second, c, d)):
        value = builder.load(target, align=8)
        value = builder.fsub(value, builder.fmul(x, p, flags=fused), flags=fused)
        value = builder.fsub(value, builder.fmul(y, q, flags=fused), flags=fused)
        builder.store(value, target, align=8)
    return context.get_dummy_value()


@intrinsic
def _intrinsic(typingctx, vector, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
    return types.void(vector, first, second, one, two, a, b, c, d), _code


_eliminate_quad: Any = _intrinsic


@overload(eliminate_quad, inline="always")
def _overload(vector, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
    return lambda vector, first, second, one, two, a, b, c, d: _eliminate_quad(
        vector, first, second, one, two, a, b, c, d
    )


@inline
def eliminate(vector, count, first, second, one, two, a, b, c, d):  # type: ignore[no-untyped-def]
    """:func:`eliminate_quad` for ``count`` numbers of each column, which is rounded up to whole quads."""
    for k in range(0, count, QUAD):
        eliminate_quad(vector, first + k, second + k, one + k, two + k, a, b, c, d)
