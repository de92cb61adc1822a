"""A Kalman filter of every body at the age of the measurements, and its forecast for now."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.estimation._cables import load_from_drones
from colift.control.estimation.base import SIGNATURE, EstimationPart
from colift.control.tuning import lag_warnings, shorter
from colift.kernel.jit import inline, kernel
from colift.kernel.math import quaternion
from colift.kernel.math.smooth import decay
from colift.part import Places, Setup, Vector, carry_rows
from colift.team import Team

FINEST = 0.5e-3
"""The forecast remembers one acceleration for every so many seconds of the delay, s."""

# Parameters: then gains (3 by 2) and gates (2) of load and drones, masses, cable lengths.
_DELAY, _TURN, _LAG, _PERIOD, _PATIENCE, _SMOOTH, _GRAVITY, _LOAD_MASS = 0, 1, 2, 3, 4, 5, 6, 7
_STEADY, _COAST, _LOAD, _DRONES, _HEAD = 8, 9, 10, 18, 26
# Memory of a body: started; time since its last sample; that sample; its state when the sample was taken:
# position, velocity, unexplained acceleration; attitude, its last sample and that one's age; thrust that acts;
# ring of known accelerations.
_AGE, _SAMPLE, _STATE, _ATTITUDE, _SEEN, _SINCE, _THRUST, _RING = 1, 2, 8, 17, 21, 25, 26, 27


@inline
def _advance(o, slot, places, dt, ax, ay, az, memory):  # type: ignore[no-untyped-def]
    """Remember a known acceleration; move the state by the one that it replaces."""
    known = (ax, ay, az)
    for k in range(3):
        old = known[k]
        if places > 0:
            ring = o + _RING + 3 * slot + k
            old = memory[ring]
            memory[ring] = known[k]
        s = o + _STATE + k
        old += memory[s + 6]
        memory[s] += dt * (memory[s + 3] + 0.5 * dt * old)
        memory[s + 3] += dt * old


@inline
def _correct(o, gains, params, memory):  # type: ignore[no-untyped-def]
    """Kalman's correction by the sample, whose surprise counts up to a bound only."""
    for k in range(3):
        s = o + _STATE + k
        p = memory[o + _SAMPLE + k] - memory[s]
        v = memory[o + _SAMPLE + 3 + k] - memory[s + 3]
        p = min(max(p, -params[gains + 6]), params[gains + 6])
        v = min(max(v, -params[gains + 7]), params[gains + 7])
        for j in range(3):
            memory[s + 3 * j] += params[gains + 2 * j] * p + params[gains + 2 * j + 1] * v


@inline
def _forecast(o, slot, places, dt, memory, k):  # type: ignore[no-untyped-def]
    """One axis of position and velocity now: the state moved through all that the ring remembers."""
    s = o + _STATE + k
    p, v = memory[s], memory[s + 3]
    for j in range(places):
        # The oldest is the one that is replaced next.
        a = memory[o + _RING + 3 * ((slot + 1 + j) % places) + k] + memory[s + 6]
        p += dt * (v + 0.5 * dt * a)
        v += dt * a
    return p, v


@inline
def _sampled(o, row, period, dt, memory, position, velocity):  # type: ignore[no-untyped-def]
    """Whether there is something new from the sensor; if so it becomes the sample."""
    memory[o + _AGE] += dt
    fresh = False
    for k in range(3):
        fresh = fresh or position[row, k] != memory[o + _SAMPLE + k]
    if fresh and memory[o + _AGE] > period - 0.5 * dt:
        for k in range(3):
            memory[o + _SAMPLE + k] = position[row, k]
            memory[o + _SAMPLE + 3 + k] = velocity[row, k]
        memory[o + _AGE] = 0.0
        return True
    return False


@inline
def _start(o, row, position, velocity, memory):  # type: ignore[no-untyped-def]
    """At rest in the mind of the filter: the first measurement is believed."""
    if memory[o] == 0.0:
        memory[o] = 1.0
        for k in range(3):
            memory[o + _SAMPLE + k] = memory[o + _STATE + k] = position[row, k]
            memory[o + _SAMPLE + 3 + k] = memory[o + _STATE + 3 + k] = velocity[row, k]


@inline
def _attitude(o, i, dt, attitudes, rates, params, memory):  # type: ignore[no-untyped-def]
    """Integrate the measured rate; of a new attitude believe a share of the turn that leads to it."""
    a = o + _ATTITUDE
    memory[o + _SINCE] += dt
    # A rate without attitudes beside it has stopped being measured as well.
    step = dt if memory[o + _SINCE] <= params[_STEADY] + 0.5 * dt else 0.0
    w, x, y, z = quaternion.turn(
        memory[a], memory[a + 1], memory[a + 2], memory[a + 3],
        rates[i, 0] * step, rates[i, 1] * step, rates[i, 2] * step,
    )  # fmt: skip
    fresh = False
    for k in range(4):
        fresh = fresh or attitudes[i, k] != memory[o + _SEEN + k]
        memory[o + _SEEN + k] = attitudes[i, k]
    if fresh:
        ew, ex, ey, ez = quaternion.multiply(
            w, -x, -y, -z, attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3]
        )
        share = 2.0 * memory[o + _SINCE] / (memory[o + _SINCE] + params[_SMOOTH])
        if ew < 0.0:
            share = -share
        w, x, y, z = quaternion.turn(w, x, y, z, share * ex, share * ey, share * ez)
        memory[o + _SINCE] = 0.0
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    memory[a] = w * scale
    memory[a + 1] = x * scale
    memory[a + 2] = y * scale
    memory[a + 3] = z * scale


@kernel(SIGNATURE)
def _predict(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, dt = now.step, now.dt
    load, positions = sees.measured_load, sees.measured_positions
    velocities, attitudes = sees.measured_velocities, sees.measured_attitudes
    rates, thrusts, tensions = sees.measured_rates, sees.thrusts, sees.received_tensions
    directions = sees.received_directions
    estimated_load, estimated_positions = writes.estimated_load, writes.estimated_positions
    estimated_velocities = writes.estimated_velocities
    estimated_attitudes, estimated_rates = writes.estimated_attitudes, writes.estimated_rates
    n = positions.shape[0]
    # Steps finer than the ring are taken several at once.
    width = memory.size // (n + 1)
    room = (width - _RING) // 3
    steps = round(params[_DELAY] / dt)
    stride = max((steps + room - 1) // room, 1)
    if step % stride != 0:
        return
    places = round(steps / stride)
    slot = (step // stride) % max(places, 1)
    dt = dt * stride
    g, m_L = params[_GRAVITY], params[_LOAD_MASS]
    keep = decay(dt, params[_LAG])
    px = py = pz = 0.0
    for i in range(n):
        o = width * (1 + i)
        m = params[_HEAD + i]
        if memory[o] == 0.0:
            memory[o + _THRUST] = thrusts[i]
            for k in range(4):
                memory[o + _ATTITUDE + k] = memory[o + _SEEN + k] = attitudes[i, k]
        _start(o, i, positions, velocities, memory)
        memory[o + _THRUST] = keep * memory[o + _THRUST] + (1.0 - keep) * thrusts[i]
        coasting = memory[o + _AGE] <= params[_COAST]
        fresh = _sampled(o, i, params[_PERIOD], dt, memory, positions, velocities)
        if fresh and not coasting:
            memory[o] = 0.0
            _start(o, i, positions, velocities, memory)
        _attitude(o, i, dt, attitudes, rates, params, memory)
        turn, a = params[_TURN], o + _ATTITUDE
        qw, qx, qy, qz = quaternion.turn(
            memory[a], memory[a + 1], memory[a + 2], memory[a + 3],
            rates[i, 0] * turn, rates[i, 1] * turn, rates[i, 2] * turn,
        )  # fmt: skip
        ux, uy, uz = quaternion.third_axis(qw, qx, qy, qz)
        f, T = memory[o + _THRUST] / m, tensions[i]
        cx, cy, cz = T * directions[i, 0], T * directions[i, 1], T * directions[i, 2]
        px, py, pz = px + cx, py + cy, pz + cz
        _advance(o, slot, places, dt, f * ux + cx / m, f * uy + cy / m, f * uz + cz / m - g, memory)
        if fresh:
            _correct(o, _DRONES, params, memory)
        for k in range(4):
            estimated_attitudes[i, k] = memory[a + k]
        for k in range(3):
            estimated_rates[i, k] = rates[i, k]
        if not (fresh or coasting):
            continue
        for k in range(3):
            p, v = _forecast(o, slot, places, dt, memory, k)
            estimated_positions[i, k] = p
            estimated_velocities[i, k] = v
    _start(0, 0, load[0:1], load[1:2], memory)
    _advance(0, slot, places, dt, -px / m_L, -py / m_L, -pz / m_L - g, memory)
    tracked = _sampled(0, 0, params[_PERIOD], dt, memory, load[0:1], load[1:2])
    s = _STATE
    if not tracked and memory[_AGE] > params[_PATIENCE] + params[_PERIOD]:
        guess = (
            memory[s], memory[s + 1], memory[s + 2], memory[s + 3], memory[s + 4], memory[s + 5]
        )  # fmt: skip
        found = load_from_drones(n, width + s, width, memory, _HEAD + n, params, guess)
        for k in range(6):
            memory[_SAMPLE + k] = found[k]
        memory[_AGE] = params[_PATIENCE]
        tracked = True
    if tracked:
        _correct(0, _LOAD, params, memory)
    for k in range(3):
        p, v = _forecast(0, slot, places, dt, memory, k)
        estimated_load[0, k] = p
        estimated_load[1, k] = v


def steady_gains(
    period: float, position: float, velocity: float, unexplained: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Steady Kalman gain (3, 2) and the standard deviations (2,) of what the measurements surprise with.

    The state is position, velocity and an acceleration that walks at random by ``unexplained`` (m/s^2
    in a second); position and velocity are measured each ``period`` with those standard deviations.
    """
    T = period
    F = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    reach = np.array([T**3 / 6.0, T**2 / 2.0, T])
    Q = unexplained**2 / T * np.outer(reach, reach)
    R = np.diag([position**2, velocity**2])
    H = np.eye(2, 3)
    P = np.diag([position**2, velocity**2, unexplained**2])
    while True:
        S = H @ P @ H.T + R
        K = P @ H.T @ np.linalg.inv(S)
        after = F @ (P - K @ H @ P) @ F.T + Q
        if np.abs(after - P).max() <= 1e-12 * np.abs(P).max():
            return K, np.sqrt(np.diag(S))
        P = 0.5 * (after + after.T)


Noise = Annotated[float, Field(gt=0.0, le=10.0)]


class Predictor(EstimationPart):
    """Kalman filters of load and drones on late, sampled, noisy measurements, carried forward to now.

    The filter runs at the time at which the measurements were taken, where they belong; thrusts, wanted
    tensions and attitudes since then carry its state forward, exactly so when they are what acts. What they
    do not explain (wind, tension errors) is a third state. Attitudes are smoothed by the measured rates but,
    like these, not carried forward: the attitude controller has the torques to do so.

    Without a load measurement for ``patience`` the load is found from the drones and their cables' lengths. A
    drone without measurements is carried forward for ``coast``.
    """

    kernel = _predict

    delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    """Age of the measured positions and velocities, s."""
    attitude_delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    """Age of the measured attitudes, s."""
    lag: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Time constant of the motors, s."""
    period: Annotated[float, Field(gt=0.0, le=1.0)] = 0.005
    """Sampling period of positions and velocities, s."""
    position_noise: Noise = 0.002
    """Standard deviation of a drone's measured position, m."""
    velocity_noise: Noise = 0.02
    """Of its velocity, m/s."""
    load_position_noise: Noise = 0.002
    """Of the load's measured position, m."""
    load_velocity_noise: Noise = 0.02
    """Of its velocity, m/s."""
    unexplained: Noise = 1.0
    """How far the acceleration that nobody commanded walks in a second, m/s^2."""
    attitude_filter: Annotated[float, Field(ge=0.0, le=10.0)] = 0.05
    """Time in which the integrated rate is drawn to the measured attitude, s; 0 believes each measurement."""
    gate: Annotated[float, Field(gt=0.0, le=1000.0)] = 100.0
    """Most surprise that a measurement may cause, standard deviations."""
    load_from: Literal["sensor", "cables"] = "sensor"
    """Where the load is known from: its own tracking as long as there is some, or the drones alone."""
    patience: Annotated[float, Field(ge=0.0, le=10.0)] = 0.05
    """How long the load's sensor may be silent before the drones fill in, s."""
    coast: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    """How long a drone is carried forward without any new sample, s; then it is left standing, for a detection to see."""
    steady: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    """How long a measured rate is integrated without a new attitude, s."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        delays = mission.sensing.delays()
        for sensor in ("load", "tracking"):
            yield from shorter("delay", self.delay, f"sensing.{sensor}_delay", delays[sensor])
        real = delays["attitude"]
        yield from shorter("attitude_delay", self.attitude_delay, "sensing.attitude_delay", real)
        yield from lag_warnings(self.lag, mission)

    def params(self, team: Team) -> Vector:
        patience = self.patience if self.load_from == "sensor" else -1.0
        head = [self.delay, self.attitude_delay, self.lag, self.period, patience]
        head += [self.attitude_filter, team.gravity, team.load_mass, self.steady, self.coast]
        for noise in (
            (self.load_position_noise, self.load_velocity_noise),
            (self.position_noise, self.velocity_noise),
        ):
            gains, surprise = steady_gains(self.period, *noise, self.unexplained)
            head += [*gains.ravel(), *(self.gate * surprise)]
        return np.concatenate([head, team.masses, team.cable_lengths])

    def memory(self, team: Team) -> Vector:
        return np.zeros(self._width * (team.n + 1))

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, self._width, self._width, places)

    @property
    def _width(self) -> int:
        return _RING + 3 * (math.ceil(self.delay / FINEST) + 1)
