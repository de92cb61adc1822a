"""All that a flight changes in one vector, so that a team is a copy and a start is too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

WORD = 8
"""Each array begins at a whole number of these, bytes."""


def gather(nested: Any) -> tuple[Any, NDArray[np.float64]]:
    """The same tuples with all their arrays in one new vector, and that vector.

    Arrays that share memory share it there too. Places follow from the order of the arrays, so that they are the same for
    flights of the same parts.
    """
    leaves = list(_arrays(nested))
    spans: list[tuple[int, int]] = []
    for begin, end in sorted(_span(leaf) for leaf in leaves if leaf.size):
        if spans and begin < spans[-1][1]:
            spans[-1] = spans[-1][0], max(spans[-1][1], end)
        else:
            spans.append((begin, end))
    begins = np.array([begin for begin, _ in spans])
    places: dict[int, int] = {}
    size = 0
    for leaf in leaves:
        if leaf.size:
            begin, end = spans[_at(begins, leaf)]
            if begin not in places:
                places[begin] = size
                size += -(-(end - begin) // WORD) * WORD
    arena = np.zeros(size // WORD)

    def moved(item: Any) -> Any:
        if isinstance(item, tuple):
            each = [moved(part) for part in item]
            return type(item)(*each) if hasattr(item, "_fields") else tuple(each)
        if not isinstance(item, np.ndarray) or not item.size:
            return item
        begin = spans[_at(begins, item)][0]
        offset = places[begin] + _span(item)[0] - begin
        there: Any = np.ndarray(item.shape, item.dtype, arena, offset)
        there[...] = item
        return there

    return moved(nested), arena


def _arrays(item: Any) -> Iterator[NDArray[Any]]:
    if isinstance(item, tuple):
        for part in item:
            yield from _arrays(part)
    elif isinstance(item, np.ndarray):
        yield item


def _span(leaf: NDArray[Any]) -> tuple[int, int]:
    begin = int(leaf.__array_interface__["data"][0])
    return begin, begin + leaf.nbytes


def _at(begins: NDArray[np.int64], leaf: NDArray[Any]) -> int:
    return int(np.searchsorted(begins, _span(leaf)[0], side="right")) - 1
