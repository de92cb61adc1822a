"""Where the cables end on the load, of a recording: one place for metrics, pages and imported logs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colift.record.recording import Recording

Array = NDArray[np.float64]


def ends_of(load: Array, n: int) -> Array:
    """Of a load that is a point, in as many rows as places: (rows, K, 3) becomes (rows, n, K, 3), without copying."""
    rows, *shape = load.shape
    return np.broadcast_to(load[:, None], (rows, n, *shape))


def cable_ends(recording: Recording) -> Array:
    """Places and velocities of the cables' ends (rows, n, 2, 3), m and m/s: as recorded, or else where the load is.

    Raises
    ------
    AbsentSignalError
        Where neither was recorded.

    """
    if "ends" in recording:
        return recording["ends"]
    return ends_of(recording["load"], recording.n)
