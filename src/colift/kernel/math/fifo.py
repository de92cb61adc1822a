"""Queues of things on their way, inside kernels: what is posted arrives when it is due.

A queue lies in a memory vector from ``o``: where its oldest item stands, how many it holds, then ``slots`` items
of ``1 + width`` numbers, the step when it is due and the values. Zeros are an empty queue.
"""

from __future__ import annotations

from colift.kernel.jit import inline


@inline
def size(slots, width):  # type: ignore[no-untyped-def]
    """Numbers that a queue takes."""
    return 2 + slots * (1 + width)


@inline
def post(memory, o, slots, width, due):  # type: ignore[no-untyped-def]
    """Place for the values of a new item that is due at a step, but not before those that went ahead.

    In a full queue the oldest item gives way.
    """
    if memory[o + 1] >= slots:
        memory[o] = (memory[o] + 1) % slots
        memory[o + 1] -= 1
    first, count = int(memory[o]), int(memory[o + 1])
    if count > 0:
        last = o + 2 + ((first + count - 1) % slots) * (1 + width)
        due = max(due, memory[last])
    item = o + 2 + ((first + count) % slots) * (1 + width)
    memory[item] = due
    memory[o + 1] += 1
    return item + 1


@inline
def fetch(memory, o, slots, width, step):  # type: ignore[no-untyped-def]
    """Place of the values of the newest item that is due by this step, or -1; all that are due are taken."""
    found = -1
    while memory[o + 1] > 0:
        item = o + 2 + int(memory[o]) * (1 + width)
        if memory[item] > step:
            break
        found = item + 1
        memory[o] = (memory[o] + 1) % slots
        memory[o + 1] -= 1
    return found
