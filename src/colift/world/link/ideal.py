"""A link without delay or loss."""

from __future__ import annotations

from colift.kernel.jit import kernel
from colift.world.link.base import SIGNATURE, LinkPart


@kernel(SIGNATURE)
def _pass(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    tensions, directions = sees.desired_tensions, sees.desired_directions
    received_tensions, received_directions = writes.received_tensions, writes.received_directions
    for i in range(tensions.shape[0]):
        writes.received_ages[i] = 0.0
        received_tensions[i] = tensions[i]
        for k in range(3):
            received_directions[i, k] = directions[i, k]


class Ideal(LinkPart):
    """What the allocator says is known to every drone at once; no settings."""

    kernel = _pass
