"""Perfect sensors: the truth, at once."""

from __future__ import annotations

from colift.kernel.jit import kernel
from colift.world.sensing.base import SIGNATURE, SensingPart


@kernel(SIGNATURE, counted=False)
def _sense(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    load, positions, velocities = sees.load, sees.positions, sees.velocities
    attitudes, rates, stuck = sees.attitudes, sees.rates, sees.stuck
    measured_load, measured_positions = writes.measured_load, writes.measured_positions
    measured_velocities, measured_attitudes = writes.measured_velocities, writes.measured_attitudes
    measured_rates, ages = writes.measured_rates, writes.measured_ages
    n = positions.shape[0]
    if stuck[n] == 0.0:
        for k in range(2):
            for m in range(3):
                measured_load[k, m] = load[k, m]
    for i in range(n):
        if stuck[i] == 0.0:
            for m in range(3):
                measured_positions[i, m] = positions[i, m]
                measured_velocities[i, m] = velocities[i, m]
                measured_rates[i, m] = rates[i, m]
            for m in range(4):
                measured_attitudes[i, m] = attitudes[i, m]
    for i in range(n + 1):
        for m in range(3):
            ages[i, m] = 0.0 if stuck[i] == 0.0 else ages[i, m] + now.dt


class Ideal(SensingPart):
    """The truth without noise or delay, but for sensors that are stuck; no settings."""

    kernel = _sense
