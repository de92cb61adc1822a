"""No supervisor: the flight goes by the time."""

from __future__ import annotations

from colift.control.supervision.base import FLYING, SIGNATURE, SupervisionPart
from colift.kernel.jit import kernel


@kernel(SIGNATURE)
def _go_on(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    writes.phase[0] = FLYING
    writes.clock[0] = now.time
    writes.clock[1] = 1.0


class Unsupervised(SupervisionPart):
    """In the air from the start, along the reference as time goes; no settings."""

    kernel = _go_on
