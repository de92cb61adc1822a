"""A network in which everybody hears everybody."""

from __future__ import annotations

from colift.kernel.jit import kernel
from colift.world.network.base import SIGNATURE, NetworkPart


@kernel(SIGNATURE)
def _carry(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    outboxes, inboxes, heard = sees.outboxes, writes.inboxes, writes.heard
    sent = 1.0 if now.step > 0 else 0.0
    for i in range(outboxes.shape[0]):
        for j in range(outboxes.shape[0]):
            heard[i, j] = sent if i != j else 0.0
            for k in range(outboxes.shape[1]):
                inboxes[i, j, k] = outboxes[j, k]


class Perfect(NetworkPart):
    """What a drone says in one cycle all others hear in the next; no settings."""

    kernel = _carry
