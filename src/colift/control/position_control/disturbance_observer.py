"""Position control that observes the force of the wind, at gains that the delay allows."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, ClassVar

from pydantic import Field

from colift.control.margins import Places
from colift.control.position_control._aim import AIM, aim, limit
from colift.control.position_control._cable import CABLE, lead
from colift.control.position_control.base import SIGNATURE, PositionControlPart
from colift.control.tuning import Delays
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.small import solve_symmetric
from colift.kernel.math.smooth import decay
from colift.part import Setup, Vector
from colift.team import Team

PARAMS = Layout(
    team={
        "g": 1, "velocity": 1, "position": 1, "observer": 1, "observer_limit": 1, "lag": 1,
        "frequency": 1, "thrust_filter": 1, "min_thrust": 1, "max_thrust": 1, "tangent": 1,
        "max_swing": 1, "delay": 1, "max_push": 1,
    },
    drone={"m": 1, "L": 1},
)  # fmt: skip
"""Bandwidths of velocity, position and observer (1/s); forces over weight; tangent of the tilt."""
MEMORY = Layout(
    drone={
        "started": 1, "direction": CABLE, "aim": AIM, "momentum": 3, "force": 3, "wind": 3,
        "thrust": 1,
    }
)  # fmt: skip
"""``momentum``: as far as it is explained; ``force``: what is observed; ``wind``: common; ``thrust``: that acts."""
P, M = PARAMS.at, MEMORY.at

DOUBT = 0.05
"""Difference from the common wind, over a drone's weight, from which its observation counts for little."""


@inline
def _observe(i, v, params, memory, o):  # type: ignore[no-untyped-def]
    """The force that explains the momentum which the known forces do not; bounded, without windup."""
    m = params[P.rows + P.width * i + P.m]
    size = 0.0
    for k in range(3):
        if memory[o + M.started] == 0.0:
            memory[o + M.momentum + k] = m * v[i, k]
        guess = params[P.observer] * (m * v[i, k] - memory[o + M.momentum + k])
        memory[o + M.force + k] = guess
        size += guess * guess
    bound = params[P.observer_limit] * m * params[P.g]
    if size > bound * bound:
        shrink = bound / math.sqrt(size)
        for k in range(3):
            memory[o + M.force + k] *= shrink
            memory[o + M.momentum + k] = m * v[i, k] - memory[o + M.force + k] / params[P.observer]


@inline
def _common_wind(n, params, memory):  # type: ignore[no-untyped-def]
    """The force that all drones feel alike, by weighted least squares.

    It is what they feel across their cables; along them it cannot be told from tension. Whose observation
    differs much from the last answer counts for little (Cauchy's weight): it has troubles of its own.
    """
    xx = yy = zz = 1e-6
    xy = xz = yz = bx = by = bz = 0.0
    for i in range(n):
        o = M.rows + M.width * i
        a, d, w = o + M.direction, o + M.force, o + M.wind
        ax, ay, az = memory[a], memory[a + 1], memory[a + 2]
        dx, dy, dz = memory[d], memory[d + 1], memory[d + 2]
        rx, ry, rz = dx - memory[w], dy - memory[w + 1], dz - memory[w + 2]
        along = ax * dx + ay * dy + az * dz
        strange = ax * rx + ay * ry + az * rz
        scale = DOUBT * params[P.rows + P.width * i + P.m] * params[P.g]
        s = 1.0 / (1.0 + (rx * rx + ry * ry + rz * rz - strange * strange) / (scale * scale))
        xx, yy, zz = xx + s * (1.0 - ax * ax), yy + s * (1.0 - ay * ay), zz + s * (1.0 - az * az)
        xy, xz, yz = xy - s * ax * ay, xz - s * ax * az, yz - s * ay * az
        bx, by, bz = (
            bx + s * (dx - along * ax),
            by + s * (dy - along * ay),
            bz + s * (dz - along * az),
        )
    return solve_symmetric(xx, xy, xz, yy, yz, zz, bx, by, bz)


@kernel(SIGNATURE)
def _observe_and_control(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    x, v, q = sees.estimated_positions, sees.estimated_velocities, sees.estimated_attitudes
    Omega, ends, T = sees.estimated_rates, sees.wanted_ends, sees.received_tensions
    alpha = sees.received_directions
    u, thrusts, attitudes = writes.drone_forces, writes.thrusts, writes.desired_attitudes
    rates = writes.desired_rates
    reeled, n = sees.reeled, x.shape[0]
    g, delay = params[P.g], params[P.delay]
    lag, keep = decay(dt, params[P.lag]), decay(dt, params[P.thrust_filter])
    omega = params[P.frequency]
    for i in range(n):
        o = M.rows + M.width * i
        if memory[o + M.started] == 0.0:
            for k in range(3):
                memory[o + M.direction + k] = alpha[i, k]
        L = params[P.rows + P.width * i + P.L] + reeled[i, 0]
        reach = params[P.max_swing] / (omega * omega * L)
        lead(i, alpha, sees.nominal_forces, omega, dt, memory, o + M.direction, reach)
        _observe(i, v, params, memory, o)
    wind = _common_wind(n, params, memory)
    for i in range(n):
        o = M.rows + M.width * i
        p = P.rows + P.width * i
        m, L = params[p + P.m], params[p + P.L] + reeled[i, 0]
        push = missing = 0.0
        for k in range(3):
            a, d = memory[o + M.direction + k], memory[o + M.force + k]
            x_e = x[i, k] - (ends[i, 0, k] - L * a)
            v_e = v[i, k] - (ends[i, 1, k] - L * memory[o + M.direction + 3 + k])
            v_e += reeled[i, 1] * a
            u[i, k] = -params[P.velocity] * (v_e + params[P.position] * x_e)
            push += u[i, k] * u[i, k]
            missing += a * (wind[k] - d)
        # No more than the attitude can follow: it needs long to turn from one bank to the other.
        share = min(1.0, params[P.max_push] / math.sqrt(max(push, 1e-12)))
        for k in range(3):
            a, d = memory[o + M.direction + k], memory[o + M.force + k]
            needed = ends[i, 2, k] - L * memory[o + M.direction + 6 + k] + (g if k == 2 else 0.0)
            turning = memory[o + M.direction + 3 + k]
            needed -= 2.0 * reeled[i, 1] * turning + reeled[i, 2] * a
            u[i, k] = m * (needed + share * u[i, k]) - T[i] * a - (d + missing * a)
        least, most = m * g * params[P.min_thrust], m * g * params[P.max_thrust]
        limit(i, u, least, most, params[P.tangent])
        norm = math.sqrt(u[i, 0] * u[i, 0] + u[i, 1] * u[i, 1] + u[i, 2] * u[i, 2])
        fresh = memory[o + M.started] == 0.0
        memory[o + M.started] = 1.0
        # What will act: the thrust along the axis that is there, not the one that is wanted; and the cable.
        thrust = norm if fresh else lag * memory[o + M.thrust] + (1.0 - lag) * norm
        memory[o + M.thrust] = thrust
        qw, qx, qy, qz = quaternion.turn(
            q[i, 0], q[i, 1], q[i, 2], q[i, 3],
            Omega[i, 0] * delay, Omega[i, 1] * delay, Omega[i, 2] * delay,
        )  # fmt: skip
        axis = quaternion.third_axis(qw, qx, qy, qz)
        for k in range(3):
            memory[o + M.wind + k] = wind[k]
            memory[o + M.momentum + k] += dt * (
                thrust * axis[k]
                + T[i] * memory[o + M.direction + k]
                + memory[o + M.force + k]
                - (m * g if k == 2 else 0.0)
            )
        aim(i, fresh, dt, keep, u, norm, memory, o + M.aim, thrusts, attitudes, rates)


class DisturbanceObserver(PositionControlPart, Delays):
    """Cable motion fed forward, PD gains from the delay, and an observer of the wind instead of an integral.

    A momentum observer per drone (De Luca and Mattone 2003) finds the force that thrust, weight and wanted
    tension do not explain. Only its part across the cable is used as it is: along the cable nobody can tell
    wind from tension, and to integrate there would strain the cables against each other and hide the load's
    true weight. That part is filled in from the wind that all drones feel alike: the force whose parts
    across all cables fit the observations best, and drones that feel something else count little. The thrust is
    taken along the measured attitude, so a drone that cannot turn at once is not taken for one in the wind.
    """

    kernel = _observe_and_control
    remembers = MEMORY
    gain_setting: ClassVar[str] = "delay"

    observer: Annotated[float, Field(gt=0.0, le=10.0)] = 3.0
    """Bandwidth of the observer over that of the position loop."""
    observer_limit: Annotated[float, Field(ge=0.0, le=2.0)] = 0.5
    """Bound on the observed force over the drone's weight."""
    frequency: Annotated[float, Field(gt=0.0, le=100.0)] = 5.0
    """Natural frequency of the reference filter on the sphere, rad/s."""
    max_swing: Annotated[float, Field(gt=0.0, le=100.0)] = 4.0
    """Most acceleration that a drone is asked for to turn its cable, m/s^2."""
    max_push: Annotated[float, Field(gt=0.0, le=100.0)] = 3.0
    """Most acceleration by which place and speed are corrected, m/s^2."""
    thrust_filter: Annotated[float, Field(ge=0.0, le=0.5)] = 0.15
    """Time constant of the derivative of the thrust direction, s."""
    min_thrust: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    """Least vertical thrust over the drone's weight."""
    max_thrust: Annotated[float, Field(gt=1.0, le=20.0)] = 2.5
    """Most thrust over the drone's weight."""
    max_tilt_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 45.0
    """Most tilt, degrees."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "position_control")

    def places(self, team: Team, axis: int) -> Places:
        band = self.bandwidths(team)
        return Places(
            band.velocity, band.velocity * band.position, lead=self.frequency,
            thrust_filter=self.thrust_filter, observer=self.observer * band.position,
        )  # fmt: skip

    def axis_delay(self) -> float:
        return self.delay if self.predicted else 0.0

    def params(self, team: Team) -> Vector:
        band = self.bandwidths(team)
        return PARAMS.pack(
            team.n, g=team.gravity, velocity=band.velocity, position=band.position,
            observer=self.observer * band.position, observer_limit=self.observer_limit,
            lag=self.lag, frequency=self.frequency, thrust_filter=self.thrust_filter,
            min_thrust=self.min_thrust, max_thrust=self.max_thrust,
            tangent=math.tan(math.radians(self.max_tilt_deg)), max_swing=self.max_swing,
            delay=self.delay if self.predicted else 0.0, max_push=self.max_push, m=team.masses,
            L=team.cable_lengths,
        )  # fmt: skip
