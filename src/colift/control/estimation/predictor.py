"""A Kalman filter of every body at the age of the measurements, and its forecast for now."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.estimation import _pose
from colift.control.estimation._cables import load_from_drones
from colift.control.estimation.base import SIGNATURE, EstimationPart
from colift.control.margins import Filter
from colift.control.tuning import lag_warnings, shorter
from colift.kernel.jit import aside, inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.ages import newer
from colift.kernel.math.smooth import decay
from colift.kernel.spans import LINE, POINT
from colift.part import Declared, Setup, Vector
from colift.team import Team
from colift.team.geometry import matrix_of
from colift.team.plan import plan, spanned

FINEST = 0.5e-3
"""The forecast remembers one acceleration for every so many seconds of the delay, s."""

SPARE = 0.02
"""By so much more than is told samples may be late, s; or by as much again, where that is more."""

WAITED = 0.1
"""Time after which a sample of a rigid load is believed however it is turned, s."""
SETTLED = 20.0
"""Time in which the filter of a rigid load settles, s, where it does."""
FAR, TURNED = 0.05, math.radians(5.0)
"""Deviations of a place, m, and turn, rad, from which on it counts as unknown."""

FILTER = Layout(team={"gain": 6, "gate": 2})
"""Gain by state (3) and measurement (2); the most that a measurement may surprise with."""
PARAMS = Layout(
    team={
        "delay": 1, "turn": 1, "lag": 1, "period": 1, "patience": 1, "smooth": 1, "g": 1, "m_L": 1,
        "steady": 1, "coast": 1, "load": FILTER.size(0), "drones": FILTER.size(0), "room": 1,
        "slots": 1, "stamped": 1, "rigid": 1, "wild": 1, "body": _pose.BODY.size(0),
    },
    drone={"m": 1, "L": 1, "arm": 3},
)  # fmt: skip
"""``turn``: age of the attitudes; ``room``: accelerations of the told delay, of ``slots`` that a body's ring
has; whether samples are ``stamped``, and the load has an attitude; sine of half the angle that is ``wild``; ``arm``: of a cable's end, from its centre of mass."""
BODY = Layout(
    team={
        "started": 1, "waited": 1, "age": 1, "sample": 6, "state": 9, "attitude": 4,
        "attitude_age": 1, "since": 1, "thrust": 1, "places": 1, "cable": _pose.CABLE.size(0), "ring": None,
    }
)  # fmt: skip
"""Time ``waited`` since the last ``sample`` came, and its ``age``; ``state`` when it was taken: position, velocity, unexplained
acceleration; age of the last measured attitude, and time ``since`` it came; ``thrust`` that acts; ``places``: of the ring, from the state's time to now; ``ring`` of known
accelerations."""
SEEN = Layout(team={"known": 1, "age": 1, "q": 4, "w": 3})
"""Of a rigid load: whether its attitude is ``known``, the age of the sample that was believed last, its attitude and rates."""
MEMORY = Layout(
    team={"load": None, "pose": _pose.POSE.size(0), "seen": SEEN.size(0)}, drone={"body": None}
)
P, F, B, S = PARAMS.at, FILTER.at, BODY.at, SEEN.at
POSE, SEEING = _pose.POSE.size(0), SEEN.size(0)
ALIVE = _pose.M.alive


@inline
def _advance(o, slot, slots, moves, dt, ax, ay, az, memory):  # type: ignore[no-untyped-def]
    """Remember a known acceleration; move the state by so many of those that follow its time, mostly one."""
    known = (ax, ay, az)
    places = int(memory[o + B.places])
    for k in range(3):
        memory[o + B.ring + 3 * slot + k] = known[k]
        s = o + B.state + k
        for move in range(moves):
            # The oldest is the one of `places` ago.
            old = memory[o + B.ring + 3 * ((slot - places + move + slots) % slots) + k]
            old += memory[s + 6]
            memory[s] += dt * (memory[s + 3] + 0.5 * dt * old)
            memory[s + 3] += dt * old
    memory[o + B.places] = places + 1 - moves


@inline
def _moves(o, fresh, slots, dt, params, memory):  # type: ignore[no-untyped-def]
    """By how many accelerations the state moves now: one more or less than time does, until it is as old as the samples are."""
    if not fresh or params[P.stamped] == 0.0:
        return 1
    places = int(memory[o + B.places])
    age = min(max(round(memory[o + B.age] / dt), 0), slots - 1)
    return 1 + min(max(places - age, -1), 1)


@inline
def _correct(o, gains, params, memory):  # type: ignore[no-untyped-def]
    """Kalman's correction by the sample, whose surprise counts up to a bound only."""
    gain, gate = gains + F.gain, gains + F.gate
    for k in range(3):
        s = o + B.state + k
        p = memory[o + B.sample + k] - memory[s]
        v = memory[o + B.sample + 3 + k] - memory[s + 3]
        p = min(max(p, -params[gate]), params[gate])
        v = min(max(v, -params[gate + 1]), params[gate + 1])
        for j in range(3):
            memory[s + 3 * j] += params[gain + 2 * j] * p + params[gain + 2 * j + 1] * v


@inline
def _forecast(o, slot, slots, dt, memory):  # type: ignore[no-untyped-def]
    """Position and velocity now: the state moved through all that the ring remembers since its time, the axes side by side."""
    s, places = o + B.state, int(memory[o + B.places])
    px, py, pz = memory[s], memory[s + 1], memory[s + 2]
    vx, vy, vz = memory[s + 3], memory[s + 4], memory[s + 5]
    ux, uy, uz = memory[s + 6], memory[s + 7], memory[s + 8]
    at = (slot - places + 1 + slots) % slots
    for _ in range(places):
        r = o + B.ring + 3 * at
        ax, ay, az = memory[r] + ux, memory[r + 1] + uy, memory[r + 2] + uz
        px += dt * (vx + 0.5 * dt * ax)
        py += dt * (vy + 0.5 * dt * ay)
        pz += dt * (vz + 0.5 * dt * az)
        vx += dt * ax
        vy += dt * ay
        vz += dt * az
        at = at + 1 if at + 1 < slots else 0
    return px, py, pz, vx, vy, vz


@inline
def _sampled(o, row, age, period, dt, memory, position, velocity):  # type: ignore[no-untyped-def]
    """Whether there is something new from the sensor; if so it becomes the sample."""
    memory[o + B.waited] += dt
    if newer(memory, o + B.age, age, dt) and memory[o + B.waited] > period - 0.5 * dt:
        for k in range(3):
            memory[o + B.sample + k] = position[row, k]
            memory[o + B.sample + 3 + k] = velocity[row, k]
        memory[o + B.age] = age
        memory[o + B.waited] = 0.0
        return True
    return False


@inline
def _start(o, row, position, velocity, memory):  # type: ignore[no-untyped-def]
    """At rest in the mind of the filter: the first measurement is believed."""
    if memory[o + B.started] == 0.0:
        memory[o + B.started] = 1.0
        for k in range(3):
            memory[o + B.sample + k] = memory[o + B.state + k] = position[row, k]
            memory[o + B.sample + 3 + k] = memory[o + B.state + 3 + k] = velocity[row, k]


@inline
def _attitude(o, i, age, dt, attitudes, rates, params, memory):  # type: ignore[no-untyped-def]
    """Integrate the measured rate; of a new attitude believe a share of the turn that leads to it. The age of what comes of it."""
    a = o + B.attitude
    memory[o + B.since] += dt
    # A rate without attitudes beside it has stopped being measured as well.
    step = dt if memory[o + B.since] <= params[P.steady] + 0.5 * dt else 0.0
    w, x, y, z = quaternion.turn(
        memory[a], memory[a + 1], memory[a + 2], memory[a + 3],
        rates[i, 0] * step, rates[i, 1] * step, rates[i, 2] * step,
    )  # fmt: skip
    if newer(memory, o + B.attitude_age, age, dt):
        memory[o + B.attitude_age] = age
        ew, ex, ey, ez = quaternion.multiply(
            w, -x, -y, -z, attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3]
        )
        share = 2.0 * memory[o + B.since] / (memory[o + B.since] + params[P.smooth])
        if ew < 0.0:
            share = -share
        w, x, y, z = quaternion.turn(w, x, y, z, share * ex, share * ey, share * ez)
        memory[o + B.since] = 0.0
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    memory[a] = w * scale
    memory[a + 1] = x * scale
    memory[a + 2] = y * scale
    memory[a + 3] = z * scale
    return age - min(memory[o + B.since], params[P.steady])


@aside
def _believed(fresh, o, q, w, age, dt, params, memory):  # type: ignore[no-untyped-def]
    """Whether a new sample of a rigid load is believed: not one that is turned wildly from where the load would have turned, until nothing else comes.

    Its attitude and rates are kept then, else those before grow older.
    """
    memory[o + S.age] += dt
    if memory[o + S.known] == 0.0:
        memory[o + S.age], memory[o + S.known] = age, 1.0
        for k in range(4):
            memory[o + S.q + k] = q[k]
        for k in range(3):
            memory[o + S.w + k] = w[k]
        return fresh
    if not fresh:
        return False
    h, a = memory[o + S.age] - age, o + S.q
    ew, ex, ey, ez = quaternion.turn(
        memory[a], memory[a + 1], memory[a + 2], memory[a + 3],
        h * memory[o + S.w], h * memory[o + S.w + 1], h * memory[o + S.w + 2],
    )  # fmt: skip
    _, x, y, z = quaternion.multiply(ew, -ex, -ey, -ez, q[0], q[1], q[2], q[3])
    off = math.sqrt(x * x + y * y + z * z)
    if not (off <= params[P.wild] or (h > WAITED and off < math.inf)):
        return False
    memory[o + S.age] = age
    for k in range(4):
        memory[o + S.q + k] = q[k]
    for k in range(3):
        memory[o + S.w + k] = w[k]
    return True


@kernel(SIGNATURE, counted=False)
def _predict(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, dt = now.step, now.dt
    load, positions = sees.measured_load, sees.measured_positions
    velocities, attitudes = sees.measured_velocities, sees.measured_attitudes
    rates, thrusts, tensions = sees.measured_rates, sees.thrusts, sees.received_tensions
    directions = sees.received_directions
    estimated_load, estimated_positions = writes.estimated_load, writes.estimated_positions
    estimated_velocities = writes.estimated_velocities
    estimated_attitudes, estimated_rates = writes.estimated_attitudes, writes.estimated_rates
    measured_ages, ages = sees.measured_ages, writes.estimated_ages
    n = positions.shape[0]
    # Steps finer than the ring are taken several at once.
    room = int(params[P.room])
    slots = int(params[P.slots])
    width = B.ring + 3 * slots
    first = width + POSE + SEEING  # the load and its pose come first
    steps = round(params[P.delay] / dt)
    stride = max((steps + room - 1) // room, 1)
    if step % stride != 0:
        for i in range(n + 1):
            for k in range(3):
                ages[i, k] += dt
        return
    places = round(steps / stride)
    slot = (step // stride) % slots
    dt = dt * stride
    g, m_L = params[P.g], params[P.m_L]
    keep = decay(dt, params[P.lag])
    px = py = pz = 0.0
    for i in range(n):
        o = first + width * i
        m = params[P.rows + P.width * i + P.m]
        if memory[o + B.started] == 0.0:
            memory[o + B.thrust] = thrusts[i]
            memory[o + B.places] = places
            memory[o + B.age] = measured_ages[i, 0] - dt
            memory[o + B.attitude_age] = measured_ages[i, 1] - dt
            for k in range(4):
                memory[o + B.attitude + k] = attitudes[i, k]
        _start(o, i, positions, velocities, memory)
        memory[o + B.thrust] = keep * memory[o + B.thrust] + (1.0 - keep) * thrusts[i]
        coasting = memory[o + B.waited] <= params[P.coast]
        fresh = _sampled(
            o, i, measured_ages[i, 0], params[P.period], dt, memory, positions, velocities
        )
        if fresh and not coasting:
            memory[o + B.started] = 0.0
            _start(o, i, positions, velocities, memory)
        ages[i, 1] = _attitude(o, i, measured_ages[i, 1], dt, attitudes, rates, params, memory)
        ages[i, 2] = measured_ages[i, 2]
        turn, a = params[P.turn], o + B.attitude
        qw, qx, qy, qz = quaternion.turn(
            memory[a], memory[a + 1], memory[a + 2], memory[a + 3],
            rates[i, 0] * turn, rates[i, 1] * turn, rates[i, 2] * turn,
        )  # fmt: skip
        ux, uy, uz = quaternion.third_axis(qw, qx, qy, qz)
        f, T = memory[o + B.thrust] / m, tensions[i]
        cx, cy, cz = T * directions[i, 0], T * directions[i, 1], T * directions[i, 2]
        px, py, pz = px + cx, py + cy, pz + cz
        moves = _moves(o, fresh, slots, dt, params, memory)
        ax, ay, az = f * ux + cx / m, f * uy + cy / m, f * uz + cz / m - g
        _advance(o, slot, slots, moves, dt, ax, ay, az, memory)
        if fresh:
            _correct(o, P.drones, params, memory)
        for k in range(4):
            estimated_attitudes[i, k] = memory[a + k]
        for k in range(3):
            estimated_rates[i, k] = rates[i, k]
        if not (fresh or coasting):
            ages[i, 0] += dt
            continue
        ages[i, 0] = 0.0
        found = _forecast(o, slot, slots, dt, memory)
        for k in range(3):
            estimated_positions[i, k] = found[k]
            estimated_velocities[i, k] = found[3 + k]
    if memory[B.started] == 0.0:
        memory[B.age] = measured_ages[n, 0] - dt
        memory[B.places] = places
    _start(0, 0, load[0:1], load[1:2], memory)
    tracked = _sampled(
        0, 0, measured_ages[n, 0], params[P.period], dt, memory, load[0:1], load[1:2]
    )
    seen = width + POSE
    if params[P.rigid] != 0.0:
        tracked = _believed(
            tracked, seen, sees.measured_load_attitude, sees.measured_load_rates, measured_ages[n, 0], dt, params, memory
        )  # fmt: skip
    if tracked and memory[width + ALIVE] != 0.0:  # heard of again
        memory[B.started] = 0.0
        _start(0, 0, load[0:1], load[1:2], memory)
        for k in range(3):
            memory[B.state + 6 + k] = 0.0
    moves = _moves(0, tracked, slots, dt, params, memory)
    _advance(0, slot, slots, moves, dt, -px / m_L, -py / m_L, -pz / m_L - g, memory)
    s = B.state
    silent = not tracked and memory[B.waited] > params[P.patience] + params[P.period]
    if params[P.rigid] != 0.0 and (silent or params[P.patience] < 0.0):
        rows = _pose.Rows(
            P.width, width, P.rows + P.arm, P.rows + P.L, P.rows + P.m, B.thrust, B.cable
        )
        _pose.follow(
            width, first, n, dt, params[P.period], params[P.patience] >= 0.0, m_L, g, P.body, rows, params, sees, memory,
            writes,
        )  # fmt: skip
        ages[n, 0] = 0.0
        return
    memory[width + ALIVE] = 0.0
    if silent:
        guess = (
            memory[s], memory[s + 1], memory[s + 2], memory[s + 3], memory[s + 4], memory[s + 5]
        )  # fmt: skip
        found = load_from_drones(
            n, first + s, width, memory, P.rows + P.L, P.width, params, sees.reeled,
            sees.found_lengths, guess,
        )  # fmt: skip
        for k in range(6):
            memory[B.sample + k] = found[k]
        memory[B.waited] = params[P.patience]
        tracked = True
    if tracked:
        _correct(0, P.load, params, memory)
    ages[n, 0] = 0.0
    found = _forecast(0, slot, slots, dt, memory)
    for k in range(3):
        estimated_load[0, k] = found[k]
        estimated_load[1, k] = found[3 + k]
    if params[P.rigid] == 0.0:
        return
    # A rigid load goes on turning as it did when it was seen.
    q, w, age = seen + S.q, seen + S.w, min(max(memory[seen + S.age], 0.0), 0.5)
    wx, wy, wz = memory[w], memory[w + 1], memory[w + 2]
    turned = quaternion.turn(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3], wx * age, wy * age, wz * age
    )
    for k in range(4):
        writes.estimated_load_attitude[k] = turned[k]
    for k in range(3):
        writes.estimated_load_rates[k] = memory[w + k]


@cache
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


def _axis(axis: Vector) -> str:
    """An axis in words, of its two senses that with the larger part above zero."""
    up = axis * np.sign(axis[np.abs(axis).argmax()])
    return f"({', '.join(f'{each:.2g}' for each in up.round(6) + 0.0)})"


Noise = Annotated[float, Field(gt=0.0, le=10.0)]


class Predictor(EstimationPart):
    """Kalman filters of load and drones on late, sampled, noisy measurements, carried forward to now.

    The filter runs at the time at which the measurements were taken, where they belong; thrusts, wanted
    tensions and attitudes since then carry its state forward, exactly so when they are what acts. What they
    do not explain (wind, tension errors) is a third state. Attitudes are smoothed by the measured rates but,
    like these, not carried forward: the attitude controller has the torques to do so.

    How late a sample is it says itself, by the time at which it was taken: so a delay that is told wrongly is found with the first
    samples, in hover too, where commands and answers have nothing to be correlated.

    Without a load measurement for ``patience`` the load is found from the drones and their cables' lengths; the pose of a rigid load also from
    the pulls that drones feel, and the laws of its motion (docs/theory/control.md). A
    drone without measurements is carried forward for ``coast``.
    """

    kernel = _predict
    remembers = MEMORY
    delays_declared = ("delay", "attitude_delay")

    @classmethod
    def declared(cls, mission: Declared) -> dict[str, Any]:
        rotors = mission.actuation
        return super().declared(mission) | ({} if rotors is None else {"lag": rotors.motor_lag()})

    delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    """Age of the measured positions and velocities, s; ``timing.delay`` where the mission has one."""
    attitude_delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    """Age of the measured attitudes, s; ``timing.delay`` where the mission has one."""
    delay_from: Literal["told", "stamps"] = "stamps"
    """Where the age of measured positions and velocities is known from: the stamps of the samples, up to twice ``delay`` or 20 ms
    more, until the first of which ``delay`` stands; or ``delay`` alone."""
    lag: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Time constant of the motors, s; that of the mission's where not given."""
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
    wild_deg: Annotated[float, Field(gt=0.0, le=180.0)] = 6.0
    """Turn from one sample of a rigid load to the next, beyond what its rates explain, from which on the sample counts as wild and is left out, degrees."""
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

        if mission.team.body is not None and self.load_from == "cables":
            for unknown in self.unseen(mission.team):
                yield "load_from", unknown

    def check(self, team: Team) -> list[tuple[str, str]]:
        if team.body is not None and self.load_from == "cables" and spanned(team)[0] == POINT:
            message = (
                "takes cables that end in two points at least for the attitude of a rigid load"
            )
            return [("load_from", message)]
        return super().check(team)

    def unseen(self, team: Team) -> list[str]:
        """What drones and cables alone leave unknown of a rigid load's pose in hover."""
        covariance, (kind, axis) = self.covariance(team), spanned(team)
        found = []
        if kind == LINE:
            found.append(
                f"leaves the load's turn about {_axis(axis)} of its frame to the laws of motion alone: that is the line through the ends of its "
                "cables, which turns about it do not move"
            )
        for name, begin, most, unit in (("place", 0, FAR, "m"), ("turn", 3, TURNED, "rad")):
            sizes, axes = np.linalg.eigh(covariance[begin : begin + 3, begin : begin + 3])
            for size, each in zip(np.sqrt(sizes), axes.T, strict=True):
                if not size < most:
                    found.append(
                        f"leaves the load's {name} {'along' if name == 'place' else 'about'} {_axis(each)} of its frame unknown: drones and cables "
                        f"alone tell it to {size:.2g} {unit}, more than {most:.2g}"
                    )
        return found

    def covariance(self, team: Team) -> Vector:
        """Of the errors of place, m, and turn, rad, (6, 6) in the load's frame, once the filter of a rigid load has settled in hover."""
        directions, tensions = plan(team)
        assert team.body is not None
        hang = matrix_of(team.body.hang)
        ends = team.body.attachments @ hang.T
        part = self.model_copy(update={"load_from": "cables"})
        memory = part.memory(team)
        seen: dict[str, Any] = {
            "measured_attitudes": np.tile([1.0, 0.0, 0.0, 0.0], (team.n, 1)),
            "measured_positions": ends - team.cable_lengths[:, None] * directions,
            "measured_specific_forces": (tensions / team.masses)[:, None] * directions,
            "received_tensions": tensions, "received_directions": directions,
        }  # fmt: skip
        for step in range(round(SETTLED / self.period)):
            part.call(team, memory, step=step, dt=self.period, **seen)
        begin = B.ring + 3 * self._slots + _pose.M.P
        size = _pose.STATE
        whole = memory[begin : begin + size * size].reshape(size, size)
        return np.array(whole[:6, :6])

    def params(self, team: Team) -> Vector:
        patience = self.patience if self.load_from == "sensor" else -1.0
        body = np.zeros(_pose.BODY.size(0))
        if team.body is not None:
            J = team.body.inertia
            body = _pose.BODY.pack(
                0, J=J.ravel(), inverse=np.linalg.inv(J).ravel(), centre=team.body.centre
            )
        return PARAMS.pack(
            team.n, delay=self.delay, turn=self.attitude_delay, lag=self.lag, period=self.period,
            patience=patience, smooth=self.attitude_filter, g=team.gravity, m_L=team.load_mass,
            steady=self.steady, coast=self.coast, room=self._room, slots=self._slots,
            stamped=float(self.delay_from == "stamps"), m=team.masses,
            L=team.cable_lengths, arm=team.levers, rigid=float(team.body is not None), body=body,
            wild=math.sin(0.5 * math.radians(self.wild_deg)),
            load=self._filter(self.load_position_noise, self.load_velocity_noise),
            drones=self._filter(self.position_noise, self.velocity_noise),
        )  # fmt: skip

    def filters(self) -> tuple[Filter, Filter]:
        drones, _ = steady_gains(
            self.period, self.position_noise, self.velocity_noise, self.unexplained
        )
        load, _ = steady_gains(
            self.period, self.load_position_noise, self.load_velocity_noise, self.unexplained
        )
        return Filter(drones / self.period, True), Filter(load / self.period, False)

    def _filter(self, position: float, velocity: float) -> Vector:
        gain, surprise = steady_gains(self.period, position, velocity, self.unexplained)
        return FILTER.pack(0, gain=gain.ravel(), gate=self.gate * surprise)

    def layout(self) -> Layout:
        width = BODY.filled(ring=3 * self._slots).size(0)
        return MEMORY.filled(load=width, body=width)

    @property
    def _room(self) -> int:
        return math.ceil(self.delay / FINEST) + 1

    @property
    def _slots(self) -> int:
        return self._room + math.ceil(max(self.delay, SPARE) / FINEST)
