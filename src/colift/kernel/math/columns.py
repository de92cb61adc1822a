"""Fields of a :class:`colift.kernel.layout.Layout` in one piece each, inside kernels."""

from __future__ import annotations

from colift.kernel.jit import splice


@splice
def column(vector, begin, count, span):  # type: ignore[no-untyped-def]
    """All that ``count`` rows from ``begin`` on have of one field, where fields stand one after the other."""
    place, size = span
    return vector[begin + count * place : begin + count * (place + size)]
