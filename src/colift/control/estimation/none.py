"""No estimator: the controllers believe the sensors."""

from __future__ import annotations

from colift.control.estimation.base import SIGNATURE, EstimationPart
from colift.kernel.jit import kernel


@kernel(SIGNATURE)
def _believe(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    load, positions = sees.measured_load, sees.measured_positions
    velocities, attitudes = sees.measured_velocities, sees.measured_attitudes
    rates = sees.measured_rates
    estimated_load, estimated_positions = writes.estimated_load, writes.estimated_positions
    estimated_velocities = writes.estimated_velocities
    estimated_attitudes, estimated_rates = writes.estimated_attitudes, writes.estimated_rates
    measured_ages, estimated_ages = sees.measured_ages, writes.estimated_ages
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
    for m in range(4):
        writes.estimated_load_attitude[m] = sees.measured_load_attitude[m]
    for m in range(3):
        writes.estimated_load_rates[m] = sees.measured_load_rates[m]
    for i in range(measured_ages.shape[0]):
        for m in range(3):
            estimated_ages[i, m] = measured_ages[i, m]


class Unfiltered(EstimationPart):
    """Measurements as they are; no settings."""

    kernel = _believe
