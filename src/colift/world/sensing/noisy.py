"""Sensors with noise, bias, sampling, delay and dropouts."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.math import fifo, noise, quaternion
from colift.part import Places, Vector, carry_rows, timing_problems
from colift.team import Team
from colift.world.sensing.base import SIGNATURE, SensingPart

Size = Annotated[float, Field(ge=0.0, le=10.0)]
Degrees = Annotated[float, Field(ge=0.0, le=45.0)]
Coordinate = Annotated[float, Field(ge=-10.0, le=10.0)]
Bias = Size | tuple[Coordinate, Coordinate, Coordinate]
Delay = Annotated[float, Field(ge=0.0, le=2.0)]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Period = Annotated[float, Field(ge=1e-5, le=1.0)]

_SENSORS = {"load": 6, "tracking": 6, "attitude": 4, "rates": 3}  # numbers in one sample
_QUANTITIES = ("load_position", "load_velocity", "position", "velocity", "attitude", "rates")
_CHANNELS = 16  # of random numbers per body: 0-6 the noise, two axes in each; 7-10 dropouts
_TURNING, _SPINNING, _LOSING = (
    3,
    5,
    7,
)  # the first of attitude, rates and dropouts; tracking has 0-2

# params: period, delay, dropout, slots of each sensor; noise, spread of bias, bias (3) of each quantity.
_SENSOR, _QUANTITY = 4, 5
_FIRST = _SENSOR * len(_SENSORS)


@inline
def _place(fresh, step, dt, key, channel, params, sensor, memory, o, width):  # type: ignore[no-untyped-def]
    """Place and number of a sensor's sample; the place is -1 if none is taken at this step or it is lost.

    The first sample of all arrives at once: bodies were at rest before. Its number is below -1, that of the bias.
    """
    s = _SENSOR * sensor
    slots, every = int(params[s + 3]), max(1, int(params[s] / dt + 0.5))
    number = step // every
    if fresh:
        return fifo.post(memory, o, slots, width, step), -2 - number
    if step % every != 0:
        return -1, number
    if (
        params[s + 2] > 0.0
        and noise.uniform(key, number, channel + _LOSING + sensor) < params[s + 2]
    ):
        return -1, number
    return fifo.post(memory, o, slots, width, step + int(params[s + 1] / dt + 0.5)), number


@inline
def _disturb(memory, at, width, key, number, channel, params, size):  # type: ignore[no-untyped-def]
    """Add normals to ``width`` numbers, three of each quantity; ``params[size]`` is the first one's deviation."""
    for c in range((width + 1) // 2):
        a, b = noise.normals(key, number, channel + c)
        m = 2 * c
        memory[at + m] += params[size + _QUANTITY * (m // 3)] * a
        if m + 1 < width:
            memory[at + m + 1] += params[size + _QUANTITY * ((m + 1) // 3)] * b


@inline
def _draw_biases(memory, o, width, key, channel, params, quantity):  # type: ignore[no-untyped-def]
    """The biases of the quantities from the given one on."""
    q = _FIRST + _QUANTITY * quantity
    for m in range(width):
        memory[o + m] = params[q + _QUANTITY * (m // 3) + 2 + m % 3]
    _disturb(memory, o, width, key, -1, channel, params, q + 1)


@kernel(SIGNATURE)
def _sense(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    load, positions, velocities = sees.load, sees.positions, sees.velocities
    attitudes, rates, stuck = sees.attitudes, sees.rates, sees.stuck
    measured_load, measured_positions = writes.measured_load, writes.measured_positions
    measured_velocities, measured_attitudes = writes.measured_velocities, writes.measured_attitudes
    measured_rates = writes.measured_rates
    n = positions.shape[0]
    # Load, then each drone: started; biases (6 or 12); queues. A drone's noise is body i + 1's.
    fresh = memory[0] == 0.0
    if fresh:
        memory[0] = 1.0
        _draw_biases(memory, 1, 6, key, 0, params, 0)
    at, number = _place(fresh, step, dt, key, 0, params, 0, memory, 7, 6)
    if at >= 0:
        for k in range(3):
            memory[at + k] = load[0, k] + memory[1 + k]
            memory[at + 3 + k] = load[1, k] + memory[4 + k]
        _disturb(memory, at, 6, key, number, 0, params, _FIRST)
    at = fifo.fetch(memory, 7, int(params[3]), 6, step)
    if at >= 0 and stuck[n] == 0.0:
        for k in range(3):
            measured_load[0, k] = memory[at + k]
            measured_load[1, k] = memory[at + 3 + k]

    head = 7 + fifo.size(int(params[3]), 6)
    tracking = 13
    turning = tracking + fifo.size(int(params[7]), 6)
    spinning = turning + fifo.size(int(params[11]), 4)
    row = spinning + fifo.size(int(params[15]), 3)
    for i in range(n):
        o = head + row * i
        channel = _CHANNELS * (i + 1)
        fresh = memory[o] == 0.0
        if fresh:
            memory[o] = 1.0
            _draw_biases(memory, o + 1, 12, key, channel, params, 2)

        at, number = _place(fresh, step, dt, key, channel, params, 1, memory, o + tracking, 6)
        if at >= 0:
            for k in range(3):
                memory[at + k] = positions[i, k] + memory[o + 1 + k]
                memory[at + 3 + k] = velocities[i, k] + memory[o + 4 + k]
            _disturb(memory, at, 6, key, number, channel, params, _FIRST + 2 * _QUANTITY)
        at = fifo.fetch(memory, o + tracking, int(params[7]), 6, step)
        if at >= 0 and stuck[i] == 0.0:
            for k in range(3):
                measured_positions[i, k] = memory[at + k]
                measured_velocities[i, k] = memory[at + 3 + k]

        at, number = _place(fresh, step, dt, key, channel, params, 2, memory, o + turning, 4)
        if at >= 0:
            for k in range(3):
                memory[at + k] = memory[o + 7 + k]
            _disturb(memory, at, 3, key, number, channel + _TURNING, params, _FIRST + 4 * _QUANTITY)
            x, y, z = 0.5 * memory[at], 0.5 * memory[at + 1], 0.5 * memory[at + 2]
            angle = math.sqrt(x * x + y * y + z * z)
            sine = math.sin(angle) / angle if angle > 0.0 else 1.0
            turned = quaternion.multiply(
                attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3],
                math.cos(angle), sine * x, sine * y, sine * z,
            )  # fmt: skip
            for k in range(4):
                memory[at + k] = turned[k]
        at = fifo.fetch(memory, o + turning, int(params[11]), 4, step)
        if at >= 0 and stuck[i] == 0.0:
            for k in range(4):
                measured_attitudes[i, k] = memory[at + k]

        at, number = _place(fresh, step, dt, key, channel, params, 3, memory, o + spinning, 3)
        if at >= 0:
            for k in range(3):
                memory[at + k] = rates[i, k] + memory[o + 10 + k]
            _disturb(
                memory, at, 3, key, number, channel + _SPINNING, params, _FIRST + 5 * _QUANTITY
            )
        at = fifo.fetch(memory, o + spinning, int(params[15]), 3, step)
        if at >= 0 and stuck[i] == 0.0:
            for k in range(3):
                measured_rates[i, k] = memory[at + k]


class Noisy(SensingPart):
    """Motion capture of load and drones, attitude and rates from each drone's own computer.

    Each sensor takes a sample every period, which is lost with the probability ``dropout`` and arrives after
    the delay; until then the last one stands. Each axis of a sample has white noise of the given standard
    deviation and a constant bias: three numbers are that bias, one is the standard deviation with which it is
    drawn by the seed. Attitudes are turned by a small rotation about the body axes. Periods are whole multiples
    of ``timing.step``; delays are rounded to it.

    Defaults: camera systems err by up to 2 mm on moving objects (Merriaux et al., Sensors 17(7):1591, 2017)
    and answer in 6 to 7 ms at 200 Hz (Qualisys with ETH Zurich, 2011); gyroscopes of flight controllers
    have some 0.01 deg/s per root Hz, to which vibration adds.
    """

    kernel = _sense

    load_position_noise: Size = 0.001
    """m."""
    load_velocity_noise: Size = 0.01
    """m/s."""
    position_noise: Size = 0.001
    """Of the drones, m."""
    velocity_noise: Size = 0.01
    """Of the drones, m/s."""
    attitude_noise_deg: Degrees = 0.1
    """Degrees."""
    rates_noise: Size = 0.01
    """rad/s."""
    load_position_bias: Bias = 0.0
    """World frame, m."""
    load_velocity_bias: Bias = 0.0
    """World frame, m/s."""
    position_bias: Bias = 0.0
    """World frame, m."""
    velocity_bias: Bias = 0.0
    """World frame, m/s."""
    attitude_bias: Bias = 0.005
    """Body frame, rad."""
    rates_bias: Bias = 0.0
    """Body frame, rad/s."""
    load_period: Period = 0.005
    """Time between two samples of the load, s."""
    load_delay: Delay = 0.007
    """s."""
    load_dropout: Share = 0.0
    """Share of the samples that is lost."""
    tracking_period: Period = 0.005
    """Time between two samples of the drones' positions and velocities, s."""
    tracking_delay: Delay = 0.007
    """s."""
    tracking_dropout: Share = 0.0
    """Share of the samples that is lost."""
    attitude_period: Period = 0.001
    """s."""
    attitude_delay: Delay = 0.002
    """s."""
    attitude_dropout: Share = 0.0
    """Share of the samples that is lost."""
    rates_period: Period = 0.001
    """s."""
    rates_delay: Delay = 0.001
    """s."""
    rates_dropout: Share = 0.0
    """Share of the samples that is lost."""

    def _slots(self, sensor: str) -> int:
        """Samples on their way at once: those of the delay, the first of all, and one to spare."""
        delay: float = getattr(self, f"{sensor}_delay")
        period: float = getattr(self, f"{sensor}_period")
        return math.ceil(delay / period) + 2

    def params(self, team: Team) -> Vector:
        packed: list[float] = []
        for sensor in _SENSORS:
            timing = [getattr(self, f"{sensor}_{name}") for name in ("period", "delay", "dropout")]
            packed += [*timing, self._slots(sensor)]
        for quantity in _QUANTITIES:
            bias = getattr(self, f"{quantity}_bias")
            spread, fixed = (0.0, bias) if isinstance(bias, tuple) else (bias, (0.0, 0.0, 0.0))
            if quantity == "attitude":
                size = math.radians(self.attitude_noise_deg)
            else:
                size = getattr(self, f"{quantity}_noise")
            packed += [size, spread, *fixed]
        return np.array(packed)

    def _sizes(self) -> tuple[int, int]:
        """Numbers in memory for the load, and for each drone."""
        queues = [int(fifo.size(self._slots(name), width)) for name, width in _SENSORS.items()]
        return 7 + queues[0], 13 + sum(queues[1:])

    def memory(self, team: Team) -> Vector:
        head, row = self._sizes()
        return np.zeros(head + row * team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, *self._sizes(), places)

    def delays(self) -> dict[str, float]:
        return {name: float(getattr(self, f"{name}_delay")) for name in _SENSORS}

    def check_timing(self, step: float, duration: float) -> list[tuple[str, str]]:
        periods = {f"{name}_period": getattr(self, f"{name}_period") for name in _SENSORS}
        delays = {f"{name}_delay": getattr(self, f"{name}_delay") for name in _SENSORS}
        return timing_problems(step, duration, periods, delays)
