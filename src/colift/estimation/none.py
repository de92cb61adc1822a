"""No estimator: the controllers believe the sensors."""

from __future__ import annotations

from colift.estimation.base import SIGNATURE, EstimationPart
from colift.jit import kernel


@kernel(SIGNATURE)
def _believe(  # type: ignore[no-untyped-def]
    step, dt, load, positions, velocities, attitudes, rates, thrusts, tensions, directions, params,
    memory, estimated_load, estimated_positions, estimated_velocities, estimated_attitudes,
    estimated_rates,
):  # fmt: skip
    for k in range(2):
        for m in range(3):
            estimated_load[k, m] = load[k, m]
    for i in range(positions.shape[0]):
        for m in range(3):
            estimated_positions[i, m] = positions[i, m]
            estimated_velocities[i, m] = velocities[i, m]
            estimated_rates[i, m] = rates[i, m]
        for m in range(4):
            estimated_attitudes[i, m] = attitudes[i, m]


class Unfiltered(EstimationPart):
    """Measurements as they are; no settings."""

    kernel = _believe
