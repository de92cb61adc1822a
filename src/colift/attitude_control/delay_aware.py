"""The paper's attitude law at gains that the delay allows, on the attitude predicted past the delay."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.attitude_control.base import SIGNATURE, AttitudeControlPart
from colift.jit import inline, kernel
from colift.math import quaternion
from colift.part import Places, Vector, carry_rows
from colift.team import Team
from colift.tuning import Delays

if TYPE_CHECKING:
    from colift.mission.mission import Mission

YAW = 0.25
"""Bandwidth of yaw over that of roll and pitch: nothing hangs on it, and its torque is small."""

# params: predicted delay, lag; rho and most angular acceleration (3 each); how long silence is made up for, and from
# when on; then J and K_d of each drone (3 each)
_COAST, _STEADY, _HEAD = 8, 9, 10
_MOST = 64  # control periods that a predicted delay may last
# Memory per drone: past torques, newest first; the torque that acts; last measured rate (3 each); time since it changed
_ACTING, _LAST, _SILENCE = 3 * _MOST, 3 * _MOST + 3, 3 * _MOST + 6
_SLOTS = 3 * _MOST + 7


@inline
def _spin(params, c, tx, ty, tz, p, q, r):  # type: ignore[no-untyped-def]
    """Angular acceleration of a drone, body frame, by Euler's equations."""
    jx, jy, jz = params[c], params[c + 1], params[c + 2]
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
    past = min(int((params[0] + params[_COAST]) / dt + 1e-9) + 1, _MOST - 1)
    keep = math.exp(-dt / params[1]) if params[1] > 0.0 else 0.0
    linger = (1.0 - keep) * params[1] / dt  # mean over a period of what is left of the old torque
    for i in range(n):
        c = _HEAD + 6 * i
        o = _SLOTS * i
        act = o + _ACTING
        silent = True
        for k in range(3):
            silent = silent and Omega[i, k] == memory[o + _LAST + k]
            memory[o + _LAST + k] = Omega[i, k]
        memory[o + _SILENCE] = memory[o + _SILENCE] + dt if silent else 0.0
        silence = min(max(memory[o + _SILENCE] - params[_STEADY], 0.0), params[_COAST])
        # Whole periods of the age of what is measured, and what is left over of one more.
        span = params[0] + silence
        whole = min(int(span / dt + 1e-9), _MOST - 1)
        rest = min(max(span - whole * dt, 0.0), dt) if whole < _MOST - 1 else 0.0
        w, x, y, z = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        rx, ry, rz = Omega[i, 0], Omega[i, 1], Omega[i, 2]
        for j in range(whole, -1, -1):
            step = rest if j == whole else dt
            if step > 1e-12:
                # Half a step of the rates, the turn by the rate in the middle, the whole step.
                tx, ty, tz = memory[o + 3 * j], memory[o + 3 * j + 1], memory[o + 3 * j + 2]
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
                memory[o + 3 * j + k] = memory[o + 3 * (j - 1) + k]
        for k in range(3):
            J, K_d, most = params[c + k], params[c + 3 + k], params[5 + k]
            # No faster towards the wanted attitude than half of the torque can stop.
            cap = math.sqrt(2.0 * most * abs(errors[k]))
            turn = min(max(params[2 + k] * errors[k], -cap), cap)
            limit = J * most
            wanted = min(max(-K_d * (turning[k] - Omega_d[i, k] + turn), -limit), limit)
            # The motors' lag is inverted: at the end of the period acts what is wanted now.
            acting = memory[act + k]
            tau[i, k] = min(max(acting + (wanted - acting) / (1.0 - keep), -limit), limit)
            memory[act + k] = keep * acting + (1.0 - keep) * tau[i, k]
            memory[o + k] = tau[i, k] + linger * (acting - tau[i, k])


class DelayAware(AttitudeControlPart, Delays):
    """``tau = -K_d (Omega_e + rho q_e)`` with gains from the delay, on a predicted attitude.

    The paper's law (eqs. 11 to 13) without its robust term, bounded by what the rotors can do: far from the wanted
    attitude it turns no faster than it can stop. With ``predicted``, attitude and rate are carried
    forward over ``delay`` by Euler's equations and the torques that acted meanwhile (a Smith predictor in
    state space; Manitius and Olbrot 1979, "finite spectrum assignment"), and the motors' lag is inverted.
    If the measured rate does not change for longer than ``steady``, it is taken to be that much older, up to
    ``coast``.
    """

    kernel = _delay_aware
    gain_setting: ClassVar[str] = "delay"

    max_acceleration: Annotated[float, Field(gt=0.0, le=1e4)] = 40.0
    """Most angular acceleration in roll and pitch, rad/s^2."""
    max_yaw_acceleration: Annotated[float, Field(gt=0.0, le=1e4)] = 2.0
    """Most angular acceleration in yaw, for which rotors have little torque, rad/s^2."""

    coast: Annotated[float, Field(ge=0.0, le=1.0)] = 0.1
    """How long the attitude is predicted without a new measurement, s."""
    steady: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    """Silence that is only the sensor's sampling, which the estimator makes up for, s."""

    def gains(self, team: Team) -> tuple[Vector, Vector, Vector]:
        rate = self.bandwidths().rate * np.array([1.0, 1.0, YAW])
        return rate * team.inertias, np.zeros((team.n, 3)), np.tile(0.5 * rate, (team.n, 1))

    def made_up_for(self) -> tuple[float, float]:
        return (self.delay, self.lag) if self.predicted else (0.0, 0.0)

    def warnings(self, mission: Mission) -> Iterable[tuple[str, str]]:
        yield from super().warnings(mission)
        yield from self.delay_warnings(mission, "attitude_control")

    def params(self, team: Team) -> Vector:
        rate = self.bandwidths().rate
        span, lag, coast = (self.delay, self.lag, self.coast) if self.predicted else (0.0, 0.0, 0.0)
        gains = rate * np.array([1.0, 1.0, YAW])
        most = [self.max_acceleration, self.max_acceleration, self.max_yaw_acceleration]
        rows = np.hstack([team.inertias, gains * team.inertias])
        return np.concatenate([[span, lag], 0.5 * gains, most, [coast, self.steady], rows.ravel()])

    def memory(self, team: Team) -> Vector:
        return np.zeros(_SLOTS * team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, 0, _SLOTS, places)
