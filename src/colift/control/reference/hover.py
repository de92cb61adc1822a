"""Stand still at one point."""

from __future__ import annotations

import numpy as np

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.part import Vector
from colift.team import Team


@kernel(SIGNATURE)
def _hover(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    reference = writes.reference
    for k in range(3):
        reference[0, k] = params[k]
        reference[1, k] = 0.0
        reference[2, k] = 0.0
        reference[3, k] = 0.0


class Hover(ReferencePart):
    """Stand still at one point."""

    kernel = _hover

    position: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Where the load hovers, world frame, m."""

    def params(self, team: Team) -> Vector:
        return np.array(self.position)
