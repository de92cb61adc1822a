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
    body = recording.mission.true_team.body
    if body is None:
        return ends_of(recording["load"], recording.n)
    return turned_ends(
        recording["load"], recording["load_attitude"], recording["load_rates"], body.attachments
    )


def turned_ends(load: Array, attitude: Array, rates: Array, attachments: Array) -> Array:
    """Of a rigid load: places and velocities (rows, n, 2, 3) of its attachments (n, 3), from its motion (rows, 2, 3), attitude and rates."""
    w, v = attitude[:, :1, None], attitude[:, None, 1:]

    def turned(vectors: Array) -> Array:
        across = 2.0 * np.cross(v, vectors)
        return np.asarray(vectors + w * across + np.cross(v, across))

    rows = np.broadcast_to(attachments, (len(load), *attachments.shape))
    places = load[:, None, 0] + turned(rows)
    speeds = load[:, None, 1] + turned(np.cross(rates[:, None], rows))
    return np.stack([places, speeds], axis=2)
