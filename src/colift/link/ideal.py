"""A link without delay or loss."""

from __future__ import annotations

from colift.jit import kernel
from colift.link.base import SIGNATURE, LinkPart


@kernel(SIGNATURE)
def _pass(  # type: ignore[no-untyped-def]
    step, key, dt, tensions, directions, params, memory, received_tensions, received_directions
):
    for i in range(tensions.shape[0]):
        received_tensions[i] = tensions[i]
        for k in range(3):
            received_directions[i, k] = directions[i, k]


class Ideal(LinkPart):
    """What the allocator says is known to every drone at once; no settings."""

    kernel = _pass
