"""The paper's attitude law at gains that the delay allows, on the attitude predicted past the delay."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.control.attitude_control.base import SIGNATURE, AttitudeControlPart
from colift.control.tuning import Delays, turning
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.ages import newer
from colift.kernel.math.smooth import decay
from colift.kernel.rounding import NO_TIME, WHOLE
from colift.part import Setup, Vector
from colift.team import Team

YAW = 0.25
"""Bandwidth of yaw over that of roll and pitch: nothing hangs on it, and its torque is small."""

Acceleration = Annotated[float, Field(gt=0.0, le=1e5)]

_MOST = 64  # control periods that a predicted delay may last

PARAMS = Layout(
    team={"delay": 1, "lag": 1, "rho": 3, "coast": 1, "steady": 1},
    drone={"J": 3, "K_d": 3, "most": 3},
)
"""``most``: angular acceleration; ``coast``: how long silence is made up for, from ``steady`` on."""
MEMORY = Layout(drone={"past": 3 * _MOST, "acting": 3, "age": 1, "silence": 1})
"""``past``: torques, newest first; ``acting``: the torque that acts; ``age`` of the newest rate, ``silence`` since it came."""
P, M = PARAMS.at, MEMORY.at


@inline
def _spin(params, c, tx, ty, tz, p, q, r):  # type: ignore[no-untyped-def]
    """Angular acceleration of a drone, body frame, by Euler's equations."""
    J = c + P.J
    jx, jy, jz = params[J], params[J + 1], params[J + 2]
    return (
        (tx - (jz - jy) * q * r) / jx,
        (ty - (jx - jz) * r * p) / jy,
        (tz - (jy - jx) * p * q) / jz,
    )


@kernel(SIGNATURE)
def _delay_aware(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    q, Omega, q_d = sees.estimated_attitudes, sees.estimated_rates, sees.desired_attitudes
    Omega_d = sees.desired_rates
    tau = writes.torques
    n = q.shape[0]
    past = min(int((params[P.delay] + params[P.coast]) / dt + WHOLE) + 1, _MOST - 1)
    keep = decay(dt, params[P.lag])
    linger = (
        (1.0 - keep) * params[P.lag] / dt
    )  # mean over a period of what is left of the old torque
    for i in range(n):
        c, o = P.rows + P.width * i, M.rows + M.width * i
        act, was = o + M.acting, o + M.past
        age = sees.estimated_ages[i, 2]
        new = newer(memory, o + M.age, age, dt)
        memory[o + M.age] = age
        memory[o + M.silence] = 0.0 if new else memory[o + M.silence] + dt
        silence = min(max(memory[o + M.silence] - params[P.steady], 0.0), params[P.coast])
        # Whole periods of the age of what is measured, and what is left over of one more.
        span = params[P.delay] + silence
        whole = min(int(span / dt + WHOLE), _MOST - 1)
        rest = min(max(span - whole * dt, 0.0), dt) if whole < _MOST - 1 else 0.0
        w, x, y, z = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        rx, ry, rz = Omega[i, 0], Omega[i, 1], Omega[i, 2]
        for j in range(whole, -1, -1):
            step = rest if j == whole else dt
            if step > NO_TIME:
                # Half a step of the rates, the turn by the rate in the middle, the whole step.
                tx, ty, tz = memory[was + 3 * j], memory[was + 3 * j + 1], memory[was + 3 * j + 2]
                ax, ay, az = _spin(params, c, tx, ty, tz, rx, ry, rz)
                mx, my, mz = rx + 0.5 * step * ax, ry + 0.5 * step * ay, rz + 0.5 * step * az
                ax, ay, az = _spin(params, c, tx, ty, tz, mx, my, mz)
                rx, ry, rz = rx + step * ax, ry + step * ay, rz + step * az
                w, x, y, z = quaternion.turn(w, x, y, z, mx * step, my * step, mz * step)
        ew, ex, ey, ez = quaternion.multiply(
            q_d[i, 0], -q_d[i, 1], -q_d[i, 2], -q_d[i, 3], w, x, y, z
        )
        # q and -q are one attitude: take the short way round.
        sign = -1.0 if ew < 0.0 else 1.0
        errors = (sign * ex, sign * ey, sign * ez)
        turning = (rx, ry, rz)
        for j in range(past, 0, -1):
            for k in range(3):
                memory[was + 3 * j + k] = memory[was + 3 * (j - 1) + k]
        # Roll and pitch share the rotors: each axis has what the other leaves.
        split = (abs(ex) + abs(ey)) / max(math.sqrt(ex * ex + ey * ey), 1e-300)
        asked = 0.0
        for k in range(3):
            J, K_d, most = params[c + P.J + k], params[c + P.K_d + k], params[c + P.most + k]
            # No faster towards the wanted attitude than half of the torque can stop.
            size = abs(errors[2]) if k == 2 else math.sqrt(ex * ex + ey * ey)
            cap = math.sqrt(2.0 * most * size / (1.0 if k == 2 else max(split, 1.0)))
            reach = params[P.rho + k] * size
            turn = errors[k] * (params[P.rho + k] if reach <= cap else cap / size)
            wanted = J * sees.desired_turning[i, k] - K_d * (turning[k] - Omega_d[i, k] + turn)
            # The motors' lag is inverted: at the end of the period acts what is wanted now.
            acting = memory[act + k]
            wanted = min(max(wanted, -J * most), J * most)
            tau[i, k] = acting + (wanted - acting) / (1.0 - keep)
            if k < 2:
                asked += abs(tau[i, k]) / (J * most)
        for k in range(3):
            limit = params[c + P.J + k] * params[c + P.most + k]
            if k == 2:
                tau[i, k] = min(max(tau[i, k], -limit), limit)
            elif asked > 1.0:
                tau[i, k] /= asked
            acting = memory[act + k]
            memory[act + k] = keep * acting + (1.0 - keep) * tau[i, k]
            memory[was + k] = tau[i, k] + linger * (acting - tau[i, k])


class DelayAware(AttitudeControlPart, Delays):
    """``tau = -K_d (Omega_e + rho q_e)`` with gains from the delay, on a predicted attitude.

    The paper's law (eqs. 11 to 13) without its robust term, bounded by what the rotors can do: far from the wanted
    attitude it turns no faster than it can stop. With ``predicted``, attitude and rate are carried
    forward over ``delay`` by Euler's equations and the torques that acted meanwhile (a Smith predictor in
    state space; Manitius and Olbrot 1979, "finite spectrum assignment"), and the motors' lag is inverted.
    If there is no new rate for longer than ``steady``, the last one is that much older, which is made up for up to
    ``coast``.
    """

    kernel = _delay_aware
    remembers = MEMORY
    gain_setting: ClassVar[str] = "delay"

    per_drone = ("max_acceleration", "max_yaw_acceleration")
    of_all = per_drone
    from_team: ClassVar[Mapping[str, float | None]] = {
        "max_acceleration": 40.0,
        "max_yaw_acceleration": 2.0,
    }

    max_acceleration: Acceleration | list[Acceleration] | None = None
    """Most angular acceleration in roll and pitch, rad/s^2. None: what the rotors can give beside their hover thrust where
    the drones' thrust, arm and rotors are known, or 40."""
    max_yaw_acceleration: Acceleration | list[Acceleration] | None = None
    """Most angular acceleration in yaw, for which rotors have little torque, rad/s^2. None: likewise, or 2."""

    coast: Annotated[float, Field(ge=0.0, le=1.0)] = 0.1
    """How long the attitude is predicted without a new measurement, s."""
    steady: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    """Silence that is only the sensor's sampling, which the estimator makes up for, s."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        tilting, yawing = turning(team)
        return {"max_acceleration": tilting, "max_yaw_acceleration": yawing}

    def gains(self, team: Team) -> tuple[Vector, Vector, Vector]:
        rate = self.bandwidths(team).rate * np.array([1.0, 1.0, YAW])
        return rate * team.inertias, np.zeros((team.n, 3)), np.tile(0.5 * rate, (team.n, 1))

    def made_up_for(self) -> tuple[float, float]:
        return (self.delay, self.lag) if self.predicted else (0.0, 0.0)

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from super().warnings(mission)
        yield from self.delay_warnings(mission, "attitude_control")

    def params(self, team: Team) -> Vector:
        span, lag, coast = (self.delay, self.lag, self.coast) if self.predicted else (0.0, 0.0, 0.0)
        gains = self.bandwidths(team).rate * np.array([1.0, 1.0, YAW])
        tilting = self.settled("max_acceleration", team)
        most = np.column_stack([tilting, tilting, self.settled("max_yaw_acceleration", team)])
        return PARAMS.pack(
            team.n, delay=span, lag=lag, rho=0.5 * gains, most=most, coast=coast, steady=self.steady,
            J=team.inertias, K_d=gains * team.inertias,
        )  # fmt: skip
