"""Queues of things on their way, inside kernels: what is posted arrives when it is due.

A queue lies in a memory vector from ``o``: which slot holds its oldest item, how many there are, then ``slots`` items,
each the step when it is due and ``width`` values. Zeros are an empty queue.
"""

from __future__ import annotations

from colift.kernel.jit import inline
from colift.kernel.layout import Layout

Q = Layout(team={"first": 1, "count": 1}, drone={"due": 1}).at
"""Each item begins with the fields of a row; its values follow."""


@inline
def size(slots, width):  # type: ignore[no-untyped-def]
    """Numbers that a queue takes."""
    return Q.rows + slots * (Q.width + width)


@inline
def post(memory, o, slots, width, due):  # type: ignore[no-untyped-def]
    """Place for the values of a new item that is due at a step, but not before those that went ahead.

    In a full queue the oldest item gives way.
    """
    if memory[o + Q.count] >= slots:
        memory[o + Q.first] = (memory[o + Q.first] + 1) % slots
        memory[o + Q.count] -= 1
    first, count = int(memory[o + Q.first]), int(memory[o + Q.count])
    if count > 0:
        last = o + Q.rows + ((first + count - 1) % slots) * (Q.width + width)
        due = max(due, memory[last + Q.due])
    item = o + Q.rows + ((first + count) % slots) * (Q.width + width)
    memory[item + Q.due] = due
    memory[o + Q.count] += 1
    return item + Q.width


@inline
def fetch(memory, o, slots, width, step):  # type: ignore[no-untyped-def]
    """Place of the values of the newest item that is due by this step, or -1; all that are due are taken."""
    found = -1
    while memory[o + Q.count] > 0:
        item = o + Q.rows + int(memory[o + Q.first]) * (Q.width + width)
        if memory[item + Q.due] > step:
            break
        found = item + Q.width
        memory[o + Q.first] = (memory[o + Q.first] + 1) % slots
        memory[o + Q.count] -= 1
    return found
