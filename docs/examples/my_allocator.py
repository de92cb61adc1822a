"""An allocator of your own: every cable carries the same share of the weight, drones on a ring.

With forces ``w_i = T_i alpha_i`` the balance ``sum w_i = -F`` is linear: give each cable ``-F/n`` and let
the cables pull against each other sideways, ``tan(cone) F_z/n`` each, which adds up to zero.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.allocation.base import SIGNATURE, AllocatorPart
from colift.kernel.jit import kernel


@kernel(SIGNATURE)  # delete this line and the same code runs as plain Python
def equal_share(now, sees, params, memory, writes):
    force = sees.force
    tensions, directions = writes.desired_tensions, writes.desired_directions
    writes.allocator_info[:] = 0.0
    if not math.isfinite(force[0] + force[1] + force[2]):
        return 3  # colift.Status.INVALID_FORCE; the last answer stands
    n = tensions.shape[0]
    pull = params[0] * abs(force[2]) / n if n > 1 else 0.0
    for i in range(n):
        azimuth = 2.0 * math.pi * i / n
        x = -force[0] / n - pull * math.cos(azimuth)
        y = -force[1] / n - pull * math.sin(azimuth)
        z = -force[2] / n
        tensions[i] = math.sqrt(x * x + y * y + z * z)
        if tensions[i] > 0.0:
            directions[i, 0] = x / tensions[i]
            directions[i, 1] = y / tensions[i]
            directions[i, 2] = z / tensions[i]
    return 0  # colift.Status.CONVERGED


class EqualShare(AllocatorPart):
    """Equal vertical shares; the ring stays level whatever the force."""

    kernel = equal_share

    cone_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 35.0
    """Half-angle of the cone for a vertical force, degrees."""

    def params(self, team):
        return np.array([math.tan(math.radians(self.cone_deg))])
