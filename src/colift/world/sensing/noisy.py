"""Sensors with noise, bias, sampling, delay and dropouts."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import fifo, noise, quaternion
from colift.part import Vector, timing_problems
from colift.team import Team
from colift.world.sensing.base import SIGNATURE, SensingPart, felt

Size = Annotated[float, Field(ge=0.0, le=10.0)]
Degrees = Annotated[float, Field(ge=0.0, le=45.0)]
Coordinate = Annotated[float, Field(ge=-10.0, le=10.0)]
Bias = Size | tuple[Coordinate, Coordinate, Coordinate]
Delay = Annotated[float, Field(ge=0.0, le=2.0)]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Period = Annotated[float, Field(ge=1e-5, le=1.0)]

_WIDTHS = {
    "load": 13,
    "tracking": 6,
    "attitude": 4,
    "rates": 3,
    "specific_force": 3,
}  # numbers in one sample, before its step
_QUANTITIES = (
    "load_position", "load_velocity", "load_attitude", "load_rates", "position", "velocity", "attitude", "rates", "specific_force",
)  # fmt: skip
_CHANNELS = 16  # of random numbers per body: 0-6 and 11-12 the noise, two axes in each; 7-10 and 13 dropouts, 14 wild samples
_TURNING, _SPINNING = 3, 5  # the first of attitude and rates; tracking has 0-2
_FEELING = 11
_LOAD_LOST, _TRACKING_LOST, _ATTITUDE_LOST, _RATES_LOST, _FEELING_LOST = 7, 8, 9, 10, 13
_LOAD_WILD = 14
_WILD = 1 << 40  # from the number of a sample to that of what makes it wild

SENSOR = Layout(team={"period": 1, "delay": 1, "dropout": 1, "slots": 1, "samples": 1})
"""``slots``: samples that may be on their way; ``samples``: where they stand, as in :data:`MEMORY`."""
QUANTITY = Layout(team={"noise": 1, "spread": 1, "bias": 3})
"""``bias`` has a part that is given and one that is drawn with the deviation ``spread``."""
PARAMS = Layout(
    team={
        **{f"{name}_sensor": SENSOR.size(0) for name in _WIDTHS},
        **{f"{name}_error": QUANTITY.size(0) for name in _QUANTITIES},
        "first_row": 1, "row": 1, "g": 1, "wild": 1, "wild_place": 1, "wild_turn": 1, "views": 2,
    }
)  # fmt: skip
"""``first_row`` and ``row``: begin and length of the drones' rows in memory."""
MEMORY = Layout(
    team={"load_started": 1, "load_bias": 6, "load_turn_bias": 6, "load_samples": None},
    drone={
        "started": 1, "bias": 15, "before": 3, "felt": 3, "steps": 1, "tracking_samples": None,
        "attitude_samples": None, "rates_samples": None, "specific_force_samples": None,
    },
)  # fmt: skip
"""Velocity a step ``before``; sum of what was ``felt`` in the ``steps`` since a sample was taken of it."""
P, S, Q, M = PARAMS.at, SENSOR.at, QUANTITY.at, MEMORY.at
_VIEWS = 1 << 16  # of random numbers, from one axis of a drone's view of the load to the next
_NEXT = QUANTITY.size(0)  # from one quantity's numbers to those of the next


@inline
def _place(fresh, step, dt, key, lost, params, sensor, memory, o, width):  # type: ignore[no-untyped-def]
    """Place and number of a sensor's sample; the place is -1 if none is taken at this step or it is lost.

    ``o`` is where the body's memory begins, ``lost`` the channel that decides on losses. The first sample of all arrives
    at once: bodies were at rest before. Its number is below -1, that of the bias. Behind its ``width`` numbers a sample
    has the step at which it is taken.
    """
    queue, slots = o + int(params[sensor + S.samples]), int(params[sensor + S.slots])
    every = max(1, int(params[sensor + S.period] / dt + 0.5))
    number, due = step // every, step
    if fresh:
        number = -2 - number
    else:
        if step % every != 0:
            return -1, number
        dropout = params[sensor + S.dropout]
        if dropout > 0.0 and noise.uniform(key, number, lost) < dropout:
            return -1, number
        due = step + int(params[sensor + S.delay] / dt + 0.5)
    at = fifo.post(memory, queue, slots, width + 1, due)
    memory[at + width] = step
    return at, number


@inline
def _arrived(step, params, sensor, memory, o, width):  # type: ignore[no-untyped-def]
    """Place of the newest of a sensor's samples that has arrived, or -1."""
    queue, slots = o + int(params[sensor + S.samples]), int(params[sensor + S.slots])
    return fifo.fetch(memory, queue, slots, width + 1, step)


@inline
def _disturb(memory, at, width, key, number, channel, params, size):  # type: ignore[no-untyped-def]
    """Add normals to ``width`` numbers, three of each quantity; ``params[size]`` is the first one's deviation."""
    for c in range((width + 1) // 2):
        a, b = noise.normals(key, number, channel + c)
        m = 2 * c
        memory[at + m] += params[size + _NEXT * (m // 3)] * a
        if m + 1 < width:
            memory[at + m + 1] += params[size + _NEXT * ((m + 1) // 3)] * b


@inline
def _draw_biases(memory, o, width, key, channel, params, quantity):  # type: ignore[no-untyped-def]
    """The biases of the quantities from the given one on."""
    for m in range(width):
        memory[o + m] = params[quantity + _NEXT * (m // 3) + Q.bias + m % 3]
    _disturb(memory, o, width, key, -1, channel, params, quantity + Q.spread)


@inline
def _turn(w, a, b, c, x, y, z):  # type: ignore[no-untyped-def]
    """The attitude ``(w, a, b, c)`` turned by a rotation vector (rad) about the axes of the body."""
    x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
    angle = math.sqrt(x * x + y * y + z * z)
    sine = math.sin(angle) / angle if angle > 0.0 else 1.0
    return quaternion.multiply(w, a, b, c, math.cos(angle), sine * x, sine * y, sine * z)


@kernel(SIGNATURE, counted=False)
def _sense(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    load, positions, velocities = sees.load, sees.positions, sees.velocities
    attitudes, rates, stuck = sees.attitudes, sees.rates, sees.stuck
    measured_load, measured_positions = writes.measured_load, writes.measured_positions
    measured_velocities, measured_attitudes = writes.measured_velocities, writes.measured_attitudes
    measured_rates, ages = writes.measured_rates, writes.measured_ages
    forces, force_ages = writes.measured_specific_forces, writes.specific_force_ages
    n = positions.shape[0]
    # The load's noise is that of body 0, a drone's that of body i + 1.
    fresh = memory[M.load_started] == 0.0
    if fresh:
        memory[M.load_started] = 1.0
        _draw_biases(memory, M.load_bias, 6, key, 0, params, P.load_position_error)
        _draw_biases(memory, M.load_turn_bias, 6, key, _TURNING, params, P.load_attitude_error)
    at, number = _place(fresh, step, dt, key, _LOAD_LOST, params, P.load_sensor, memory, 0, 13)
    if at >= 0:
        for k in range(3):
            memory[at + k] = load[0, k] + memory[M.load_bias + k]
            memory[at + 3 + k] = load[1, k] + memory[M.load_bias + 3 + k]
        _disturb(memory, at, 6, key, number, 0, params, P.load_position_error + Q.noise)
        for k in range(3):
            memory[at + 6 + k] = memory[M.load_turn_bias + k]
            memory[at + 10 + k] = sees.load_rates[k] + memory[M.load_turn_bias + 3 + k]
        sizes = P.load_attitude_error + Q.noise
        _disturb(memory, at + 6, 3, key, number, _TURNING, params, sizes)
        _disturb(memory, at + 10, 3, key, number, _SPINNING, params, sizes + _NEXT)
        # The first of all says where all begins, and is never wild.
        often = params[P.wild] if number >= 0 else 0.0
        if often > 0.0 and noise.uniform(key, number, _LOAD_WILD) < often:
            for k in range(3):
                a, b = noise.normals(key, number + _WILD, k)
                memory[at + k] += params[P.wild_place] * a
                memory[at + 6 + k] += params[P.wild_turn] * b
        q = sees.load_attitude
        turned = _turn(q[0], q[1], q[2], q[3], memory[at + 6], memory[at + 7], memory[at + 8])
        for k in range(4):
            memory[at + 6 + k] = turned[k]
    at = _arrived(step, params, P.load_sensor, memory, 0, 13)
    if at >= 0 and stuck[n] == 0.0:
        for k in range(3):
            measured_load[0, k] = memory[at + k]
            measured_load[1, k] = memory[at + 3 + k]
            writes.measured_load_rates[k] = memory[at + 10 + k]
        for k in range(4):
            writes.measured_load_attitude[k] = memory[at + 6 + k]
        ages[n, 0] = (step - memory[at + 13]) * dt
    else:
        ages[n, 0] += dt

    first, row = int(params[P.first_row]), int(params[P.row])
    for i in range(n):
        o = first + row * i
        bias, channel = o + M.bias, _CHANNELS * (i + 1)
        fresh = memory[o + M.started] == 0.0
        if fresh:
            memory[o + M.started] = 1.0
            _draw_biases(memory, bias, 12, key, channel, params, P.position_error)
            for m in range(6):
                size = params[P.views + m // 3]
                writes.load_views[i, m // 3, m % 3] = size * noise.normal(
                    key, -1, _VIEWS * (m + 1) + channel
                )
            _draw_biases(
                memory, bias + 12, 3, key, channel + _FEELING, params, P.specific_force_error
            )
            for k in range(3):
                memory[o + M.before + k] = velocities[i, k]

        sensor, lost = P.tracking_sensor, channel + _TRACKING_LOST
        at, number = _place(fresh, step, dt, key, lost, params, sensor, memory, o, 6)
        if at >= 0:
            for k in range(3):
                memory[at + k] = positions[i, k] + memory[bias + k]
                memory[at + 3 + k] = velocities[i, k] + memory[bias + 3 + k]
            _disturb(memory, at, 6, key, number, channel, params, P.position_error + Q.noise)
        at = _arrived(step, params, sensor, memory, o, 6)
        if at >= 0 and stuck[i] == 0.0:
            for k in range(3):
                measured_positions[i, k] = memory[at + k]
                measured_velocities[i, k] = memory[at + 3 + k]
            ages[i, 0] = (step - memory[at + 6]) * dt
        else:
            ages[i, 0] += dt

        sensor, lost = P.attitude_sensor, channel + _ATTITUDE_LOST
        at, number = _place(fresh, step, dt, key, lost, params, sensor, memory, o, 4)
        if at >= 0:
            for k in range(3):
                memory[at + k] = memory[bias + 6 + k]
            _disturb(
                memory, at, 3, key, number, channel + _TURNING, params, P.attitude_error + Q.noise
            )
            turned = _turn(
                attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3],
                memory[at], memory[at + 1], memory[at + 2],
            )  # fmt: skip
            for k in range(4):
                memory[at + k] = turned[k]
        at = _arrived(step, params, sensor, memory, o, 4)
        if at >= 0 and stuck[i] == 0.0:
            for k in range(4):
                measured_attitudes[i, k] = memory[at + k]
            ages[i, 1] = (step - memory[at + 4]) * dt
        else:
            ages[i, 1] += dt

        sensor, lost = P.rates_sensor, channel + _RATES_LOST
        at, number = _place(fresh, step, dt, key, lost, params, sensor, memory, o, 3)
        if at >= 0:
            for k in range(3):
                memory[at + k] = rates[i, k] + memory[bias + 9 + k]
            _disturb(
                memory, at, 3, key, number, channel + _SPINNING, params, P.rates_error + Q.noise
            )
        at = _arrived(step, params, sensor, memory, o, 3)
        if at >= 0 and stuck[i] == 0.0:
            for k in range(3):
                measured_rates[i, k] = memory[at + k]
            ages[i, 2] = (step - memory[at + 3]) * dt
        else:
            ages[i, 2] += dt

        force = felt(i, velocities, attitudes, memory, o + M.before, params[P.g], dt)
        memory[o + M.steps] += 1.0
        for k in range(3):
            memory[o + M.felt + k] += force[k]
        sensor, lost = P.specific_force_sensor, channel + _FEELING_LOST
        at, number = _place(fresh, step, dt, key, lost, params, sensor, memory, o, 3)
        if at >= 0:
            for k in range(3):
                mean = memory[o + M.felt + k] / memory[o + M.steps]
                memory[at + k] = mean + memory[bias + 12 + k]
                memory[o + M.felt + k] = 0.0
            memory[o + M.steps] = 0.0
            _disturb(
                memory, at, 3, key, number, channel + _FEELING, params,
                P.specific_force_error + Q.noise,
            )  # fmt: skip
        at = _arrived(step, params, sensor, memory, o, 3)
        if at >= 0 and stuck[i] == 0.0:
            for k in range(3):
                forces[i, k] = memory[at + k]
            force_ages[i] = (step - memory[at + 3]) * dt
        else:
            force_ages[i] += dt


class Noisy(SensingPart):
    """Motion capture of load and drones; attitude, rates and specific force from each drone's own computer.

    Each sensor takes a sample every period, which is lost with the probability ``dropout`` and arrives after
    the delay; until then the last one stands. Each axis of a sample has white noise of the given standard
    deviation and a constant bias: three numbers are that bias, one is the standard deviation with which it is
    drawn by the seed. Attitudes are turned by a small rotation about the body axes. An accelerometer's sample is
    the mean since the one before, as of a sensor that integrates. Periods are whole multiples
    of ``timing.step``; delays are rounded to it, and are ``timing.delay`` where the mission has one.

    Defaults: camera systems err by up to 2 mm on moving objects (Merriaux et al., Sensors 17(7):1591, 2017)
    and answer in 6 to 7 ms at 200 Hz (Qualisys with ETH Zurich, 2011); gyroscopes of flight controllers
    have some 0.01 deg/s per root Hz, to which vibration adds. Accelerometers such as Bosch's BMI088 have 0.017 m/s^2 in
    100 Hz and an offset of 0.2 m/s^2 (data sheet): vibration adds to the one, calibration takes from the other.
    """

    kernel = _sense
    remembers = MEMORY
    delays_declared = tuple(f"{name}_delay" for name in _WIDTHS)

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
    specific_force_noise: Size = 0.2
    """Of a sample, m/s^2."""
    load_attitude_noise_deg: Degrees = 0.2
    """Of a rigid load, degrees."""
    load_rates_noise: Size = 0.02
    """Of a rigid load, rad/s."""
    load_position_bias: Bias = 0.0
    """World frame, m."""
    load_velocity_bias: Bias = 0.0
    """World frame, m/s."""
    load_attitude_bias: Bias = 0.0
    """Of a rigid load, its frame, rad."""
    load_rates_bias: Bias = 0.0
    """Of a rigid load, its frame, rad/s."""
    position_bias: Bias = 0.0
    """World frame, m."""
    velocity_bias: Bias = 0.0
    """World frame, m/s."""
    attitude_bias: Bias = 0.005
    """Body frame, rad."""
    rates_bias: Bias = 0.0
    """Body frame, rad/s."""
    specific_force_bias: Bias = 0.05
    """Body frame, m/s^2."""
    load_view: Size = 0.0
    """Standard deviation of the place, along each axis, at which each drone without a leader takes the load to be beside what is
    measured, m: steady, as of a camera of its own."""
    push_view: Size = 0.0
    """The same of the force that it takes to push the load, N."""
    load_period: Period = 0.005
    """Time between two samples of the load, s."""
    load_delay: Delay = 0.007
    """s."""
    load_dropout: Share = 0.0
    """Share of the samples that is lost."""
    load_wild: Share = 0.0
    """Share of the samples that are wild, as where markers are taken for others: place and attitude jump, for this sample."""
    load_wild_position: Size = 0.3
    """Standard deviation of that jump in place, each axis, m."""
    load_wild_attitude_deg: Annotated[float, Field(ge=0.0, le=180.0)] = 60.0
    """And in the attitude of a rigid load, about each axis, degrees."""
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
    specific_force_period: Period = 0.01
    """s."""
    specific_force_delay: Delay = 0.002
    """s."""
    specific_force_dropout: Share = 0.0
    """Share of the samples that is lost."""

    def _slots(self, sensor: str) -> int:
        """Samples on their way at once: those of the delay, the first of all, and one to spare."""
        delay: float = getattr(self, f"{sensor}_delay")
        period: float = getattr(self, f"{sensor}_period")
        return math.ceil(delay / period) + 2

    def params(self, team: Team) -> Vector:
        where, packed = self.layout().at, {}
        for sensor in _WIDTHS:
            timing = {
                name: getattr(self, f"{sensor}_{name}") for name in ("period", "delay", "dropout")
            }
            samples = getattr(where, f"{sensor}_samples")
            packed[f"{sensor}_sensor"] = SENSOR.pack(
                0, **timing, slots=self._slots(sensor), samples=samples
            )
        for quantity in _QUANTITIES:
            bias = getattr(self, f"{quantity}_bias")
            spread, fixed = (0.0, bias) if isinstance(bias, tuple) else (bias, (0.0, 0.0, 0.0))
            if quantity.endswith("attitude"):
                size = math.radians(getattr(self, f"{quantity}_noise_deg"))
            else:
                size = getattr(self, f"{quantity}_noise")
            packed[f"{quantity}_error"] = QUANTITY.pack(0, noise=size, spread=spread, bias=fixed)
        wild = {
            "wild": self.load_wild, "wild_place": self.load_wild_position,
            "wild_turn": math.radians(self.load_wild_attitude_deg),
        }  # fmt: skip
        return PARAMS.pack(
            team.n,
            first_row=where.rows,
            row=where.width,
            g=team.gravity,
            views=(self.load_view, self.push_view),
            **wild,
            **packed,
        )

    def layout(self) -> Layout:
        queues = {name: fifo.size(self._slots(name), width + 1) for name, width in _WIDTHS.items()}
        return MEMORY.filled(**{f"{name}_samples": int(size) for name, size in queues.items()})

    def delays(self) -> dict[str, float]:
        return {name: float(getattr(self, f"{name}_delay")) for name in _WIDTHS}

    def check_timing(self, step: float, duration: float) -> list[tuple[str, str]]:
        periods = {f"{name}_period": getattr(self, f"{name}_period") for name in _WIDTHS}
        delays = {f"{name}_delay": getattr(self, f"{name}_delay") for name in _WIDTHS}
        return timing_problems(step, duration, periods, delays)
