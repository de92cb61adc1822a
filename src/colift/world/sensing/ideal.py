"""Perfect sensors: the truth, at once."""

from __future__ import annotations

import numpy as np

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team
from colift.world.sensing.base import SIGNATURE, SensingPart, felt

MEMORY = Layout(drone={"started": 1, "before": 3})
"""Velocity a step ``before``."""
M = MEMORY.at


@kernel(SIGNATURE, counted=False)
def _sense(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    load, positions, velocities = sees.load, sees.positions, sees.velocities
    attitudes, rates, stuck = sees.attitudes, sees.rates, sees.stuck
    measured_load, measured_positions = writes.measured_load, writes.measured_positions
    measured_velocities, measured_attitudes = writes.measured_velocities, writes.measured_attitudes
    measured_rates, ages = writes.measured_rates, writes.measured_ages
    forces, force_ages = writes.measured_specific_forces, writes.specific_force_ages
    n = positions.shape[0]
    if stuck[n] == 0.0:
        for k in range(2):
            for m in range(3):
                measured_load[k, m] = load[k, m]
        for m in range(4):
            writes.measured_load_attitude[m] = sees.load_attitude[m]
        for m in range(3):
            writes.measured_load_rates[m] = sees.load_rates[m]
    for i in range(n):
        o = M.rows + M.width * i
        if memory[o + M.started] == 0.0:  # at rest, or as fast as what it joins
            memory[o + M.started] = 1.0
            for m in range(3):
                memory[o + M.before + m] = velocities[i, m]
        force = felt(i, velocities, attitudes, memory, o + M.before, params[0], now.dt)
        force_ages[i] += now.dt
        if stuck[i] == 0.0:
            force_ages[i] = 0.0
            for m in range(3):
                forces[i, m] = force[m]
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
    remembers = MEMORY

    def params(self, team: Team) -> Vector:
        return np.array([team.gravity])
