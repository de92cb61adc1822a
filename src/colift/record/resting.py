"""When the load rests on the ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from colift.record.recording import Recording

BOUNCE = 0.25
"""Time for which a load that leaves the ground between two contacts counts as lying there, s."""


def rests(recording: Recording) -> NDArray[np.bool_]:
    """Rows in which the load lies on the ground; none where nothing is known of it."""
    found = np.zeros(len(recording.time), dtype=bool)
    if "ground_forces" not in recording:
        return found
    touching = np.flatnonzero(recording["ground_forces"][:, -1, 2] > 0.0)
    found[touching] = True
    # A force is that of a step's begin, what else is recorded that of its end.
    found[np.maximum(touching - 1, 0)] = True
    if touching.size and recording.time[touching[0]] - recording.time[0] <= BOUNCE:
        found[: touching[0]] = True
    for first, last in zip(touching[:-1].tolist(), touching[1:].tolist(), strict=True):
        if last > first + 1 and recording.time[last] - recording.time[first] <= BOUNCE:
            found[first:last] = True
    return found
