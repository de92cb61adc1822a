"""Small stand-ins for the world, so that controllers can be tested against known errors."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from colift import part
from colift.disturbance import base as disturbance
from colift.jit import kernel
from colift.math import noise
from colift.sensing import base as sensing

_ROW = 13  # position, velocity, attitude, rate of a drone
_HEAD = 3  # memory: steps so far; place and size of the ring of past states


@kernel(sensing.SIGNATURE)
def _late(  # type: ignore[no-untyped-def]
    step, key, dt, load, positions, velocities, attitudes, rates, stuck, params, memory,
    measured_load, measured_positions, measured_velocities, measured_attitudes, measured_rates,
):  # fmt: skip
    n = positions.shape[0]
    late = min(round(params[0] / dt), int(params[8]))
    every = max(round(params[1] / dt), 1)
    width = 6 + _ROW * n
    depth = late + 1
    here = 1 + width * (step % depth)
    for k in range(2):
        for m in range(3):
            memory[here + 3 * k + m] = load[k, m]
    for i in range(n):
        o = here + 6 + _ROW * i
        for m in range(3):
            memory[o + m] = positions[i, m]
            memory[o + 3 + m] = velocities[i, m]
            memory[o + 10 + m] = rates[i, m]
        for m in range(4):
            memory[o + 6 + m] = attitudes[i, m]
    if step % every != 0:
        return
    then = 1 + width * (max(step - late, 0) % depth)
    for k in range(2):
        for m in range(3):
            measured_load[k, m] = memory[then + 3 * k + m] + params[2 + k] * noise.normal(
                key, step, 3 * k + m
            )
    for i in range(n):
        o = then + 6 + _ROW * i
        c = 6 + _ROW * i
        for m in range(3):
            measured_positions[i, m] = memory[o + m] + params[4] * noise.normal(key, step, c + m)
            measured_velocities[i, m] = memory[o + 3 + m] + params[5] * noise.normal(
                key, step, c + 3 + m
            )
            measured_rates[i, m] = memory[o + 10 + m] + params[7] * noise.normal(
                key, step, c + 10 + m
            )
        size = 0.0
        for m in range(4):
            q = memory[o + 6 + m] + 0.5 * params[6] * noise.normal(key, step, c + 6 + m)
            measured_attitudes[i, m] = q
            size += q * q
        for m in range(4):
            measured_attitudes[i, m] /= np.sqrt(size)


Size = Annotated[float, Field(ge=0.0)]


class LateSensors(sensing.SensingPart):
    """Everything is sampled, late and noisy."""

    kernel = _late

    delay: Size = 0.0
    """s."""
    period: Size = 0.0
    """s."""
    load_position: Size = 0.0
    """Standard deviation, m."""
    load_velocity: Size = 0.0
    """m/s."""
    position: Size = 0.0
    """m."""
    velocity: Size = 0.0
    """m/s."""
    attitude: Size = 0.0
    """rad."""
    rate: Size = 0.0
    """rad/s."""
    longest: int = 100
    """Longest delay, steps."""

    def params(self, team):
        """Pack."""
        return np.array(
            [self.delay, self.period, self.load_position, self.load_velocity, self.position,
             self.velocity, self.attitude, self.rate, float(self.longest)]
        )  # fmt: skip

    def memory(self, team):
        """Ring of past states."""
        return np.zeros(1 + (self.longest + 1) * (6 + _ROW * team.n))


@kernel(disturbance.SIGNATURE)
def _blow(  # type: ignore[no-untyped-def]
    step, key, dt, load, positions, velocities, attitudes, directions, direction_rates, thrusts,
    attached, params, memory, wind, external,
):  # fmt: skip
    n = positions.shape[0]
    keep = np.exp(-dt / params[4])
    for k in range(3):
        memory[k] = keep * memory[k] + params[3] * np.sqrt(1.0 - keep * keep) * noise.normal(
            key, step, k
        )
        wind[k] += params[k] + memory[k]
    for i in range(n + 1):
        area = params[5] if i < n else params[6]
        size = 0.0
        for k in range(3):
            v = velocities[i, k] if i < n else load[1, k]
            size += (wind[k] - v) ** 2
        size = np.sqrt(size)
        for k in range(3):
            v = velocities[i, k] if i < n else load[1, k]
            external[i, k] += 0.6125 * area * size * (wind[k] - v)


class GustyWind(disturbance.DisturbancePart):
    """Mean wind and gusts (Ornstein-Uhlenbeck), drag on drones and load."""

    kernel = _blow
    makes_wind = True

    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """m/s."""
    gust: Size = 0.0
    """Standard deviation per axis, m/s."""
    memory_time: Size = 1.0
    """s."""
    drone_area: Size = 0.012
    """Drag area, m^2."""
    load_area: Size = 0.005
    """Drag area, m^2."""

    def params(self, team):
        """Pack."""
        return np.array([*self.mean, self.gust, self.memory_time, self.drone_area, self.load_area])

    def memory(self, team):
        """Gust."""
        return np.zeros(3)


def register():
    """Make both available to missions."""
    part.register("rig-late", LateSensors)
    part.register("rig-wind", GustyWind)


SLOW = {
    f"timing.{layer}": 0.01
    for layer in ("load_control", "allocation", "position_control", "attitude_control")
}
LATE = {"sensing.kind": "rig-late", "sensing.delay": 0.02}
NOISE = {
    "sensing.kind": "rig-late", "sensing.period": 0.01, "sensing.load_position": 0.01,
    "sensing.load_velocity": 0.05, "sensing.position": 0.01, "sensing.velocity": 0.03,
    "sensing.attitude": 0.01, "sensing.rate": 0.02,
}  # fmt: skip
WIND = [{"kind": "rig-wind", "mean": [8.7, 5.0, 0.0], "gust": 1.5}]
