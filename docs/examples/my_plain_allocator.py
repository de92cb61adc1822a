"""The same allocator in plain Python with NumPy: slower, but anything may be called."""

import numpy as np

from colift.control.allocation.base import AllocatorPart


def equal_share(now, sees, params, memory, writes):
    force = sees.force
    tensions, directions = writes.desired_tensions, writes.desired_directions
    if not np.isfinite(force).all():
        return 3
    n = len(tensions)
    azimuth = 2 * np.pi * np.arange(n) / n
    outward = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n)])
    pull = np.tan(np.radians(35.0)) * abs(force[2]) / n if n > 1 else 0.0
    pulls = -force / n - pull * outward
    tensions[:] = np.linalg.norm(pulls, axis=1)
    taut = tensions > 0
    directions[taut] = pulls[taut] / tensions[taut, None]
    writes.allocator_info[:] = 0
    return 0


class PlainEqualShare(AllocatorPart):
    """Equal vertical shares on a ring of 35 degrees."""

    kernel = equal_share
