"""No supervisor: the flight goes by the time, and at the pace that is given."""

from __future__ import annotations

from colift.control.supervision.base import FLYING, SIGNATURE, SupervisionPart
from colift.kernel.jit import kernel
from colift.kernel.math.leaning import paced


@kernel(SIGNATURE)
def _go_on(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    writes.phase[0] = FLYING
    writes.clock[0], writes.clock[1], writes.clock_bends[0], writes.clock_bends[1] = paced(
        sees.pace, now.time
    )


class Unsupervised(SupervisionPart):
    """In the air from the start, along the reference as time goes; no settings."""

    kernel = _go_on
