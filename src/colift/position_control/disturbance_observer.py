"""Position control that observes the force of the wind, at gains that the delay allows."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from colift.jit import inline, kernel
from colift.math import quaternion
from colift.math.small import solve_symmetric
from colift.math.sphere import follow
from colift.part import Places, Vector, carry_rows
from colift.position_control._aim import aim
from colift.position_control.base import SIGNATURE, PositionControlPart
from colift.team import Team
from colift.tuning import Delays

if TYPE_CHECKING:
    from colift.mission.mission import Mission

# params: g; velocity and position bandwidth; observer bandwidth, its bound over weight; lag of the motors; frequency
# of the cables; time constant of the thrust's rate; least and most thrust over weight, tangent of the tilt; most
# acceleration for turning a cable; delay of the attitude; most acceleration of the feedback.
_HEAD = 14  # then m, L
# Memory per drone: started; direction, its rate and acceleration; thrust direction and its rate; momentum as far as
# it is explained; force that is observed; common wind (3 each); thrust that acts.
_DIRECTION, _RATE, _ACCELERATION, _AIM, _MOMENTUM, _FORCE, _WIND, _THRUST = (
    1,
    4,
    7,
    10,
    16,
    19,
    22,
    25,
)
_SLOTS = 26

DOUBT = 0.05
"""Difference from the common wind, over a drone's weight, from which its observation counts for little."""


@inline
def _observe(i, v, params, memory, o):  # type: ignore[no-untyped-def]
    """The force that explains the momentum which the known forces do not; bounded, without windup."""
    m = params[_HEAD + i]
    size = 0.0
    for k in range(3):
        if memory[o] == 0.0:
            memory[o + _MOMENTUM + k] = m * v[i, k]
        guess = params[3] * (m * v[i, k] - memory[o + _MOMENTUM + k])
        memory[o + _FORCE + k] = guess
        size += guess * guess
    bound = params[4] * m * params[0]
    if size > bound * bound:
        shrink = bound / math.sqrt(size)
        for k in range(3):
            memory[o + _FORCE + k] *= shrink
            memory[o + _MOMENTUM + k] = m * v[i, k] - memory[o + _FORCE + k] / params[3]


@inline
def _limit(i, u, least, most, tangent):  # type: ignore[no-untyped-def]
    """Clip a wanted thrust vector to what the drone can give; height goes before place."""
    u[i, 2] = min(max(u[i, 2], least), most)
    across = math.sqrt(u[i, 0] * u[i, 0] + u[i, 1] * u[i, 1])
    room = min(tangent * u[i, 2], math.sqrt(max(most * most - u[i, 2] * u[i, 2], 0.0)))
    if across > room:
        u[i, 0] *= room / across
        u[i, 1] *= room / across


@inline
def _common_wind(n, params, memory):  # type: ignore[no-untyped-def]
    """The force that all drones feel alike, by weighted least squares.

    It is what they feel across their cables; along them it cannot be told from tension. Whose observation
    differs much from the last answer counts for little (Cauchy's weight): it has troubles of its own.
    """
    xx = yy = zz = 1e-6
    xy = xz = yz = bx = by = bz = 0.0
    for i in range(n):
        o = _SLOTS * i
        a, d, w = o + _DIRECTION, o + _FORCE, o + _WIND
        ax, ay, az = memory[a], memory[a + 1], memory[a + 2]
        dx, dy, dz = memory[d], memory[d + 1], memory[d + 2]
        rx, ry, rz = dx - memory[w], dy - memory[w + 1], dz - memory[w + 2]
        along = ax * dx + ay * dy + az * dz
        strange = ax * rx + ay * ry + az * rz
        scale = DOUBT * params[_HEAD + i] * params[0]
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
    Omega, reference, T = sees.estimated_rates, sees.reference, sees.received_tensions
    alpha = sees.received_directions
    u, thrusts, attitudes = writes.drone_forces, writes.thrusts, writes.desired_attitudes
    rates = writes.desired_rates
    n = x.shape[0]
    g = params[0]
    lag = math.exp(-dt / params[5]) if params[5] > 0.0 else 0.0
    keep = math.exp(-dt / params[7]) if params[7] > 0.0 else 0.0
    delay = params[12]
    for i in range(n):
        o = _SLOTS * i
        if memory[o] == 0.0:
            for k in range(3):
                memory[o + _DIRECTION + k] = alpha[i, k]
        reach = params[11] / (params[6] * params[6] * params[_HEAD + n + i])
        follow(memory, o + _DIRECTION, alpha[i, 0], alpha[i, 1], alpha[i, 2], params[6], dt, reach)
        _observe(i, v, params, memory, o)
    wind = _common_wind(n, params, memory)
    for i in range(n):
        o = _SLOTS * i
        m, L = params[_HEAD + i], params[_HEAD + n + i]
        push = missing = 0.0
        for k in range(3):
            a, d = memory[o + _DIRECTION + k], memory[o + _FORCE + k]
            x_e = x[i, k] - (reference[0, k] - L * a)
            v_e = v[i, k] - (reference[1, k] - L * memory[o + _RATE + k])
            u[i, k] = -params[1] * (v_e + params[2] * x_e)
            push += u[i, k] * u[i, k]
            missing += a * (wind[k] - d)
        # No more than the attitude can follow: it needs long to turn from one bank to the other.
        share = min(1.0, params[13] / math.sqrt(max(push, 1e-12)))
        for k in range(3):
            a, d = memory[o + _DIRECTION + k], memory[o + _FORCE + k]
            needed = reference[2, k] - L * memory[o + _ACCELERATION + k] + (g if k == 2 else 0.0)
            u[i, k] = m * (needed + share * u[i, k]) - T[i] * a - (d + missing * a)
        _limit(i, u, m * g * params[8], m * g * params[9], params[10])
        norm = math.sqrt(u[i, 0] * u[i, 0] + u[i, 1] * u[i, 1] + u[i, 2] * u[i, 2])
        fresh = memory[o] == 0.0
        memory[o] = 1.0
        # What will act: the thrust along the axis that is there, not the one that is wanted; and the cable.
        thrust = norm if fresh else lag * memory[o + _THRUST] + (1.0 - lag) * norm
        memory[o + _THRUST] = thrust
        qw, qx, qy, qz = quaternion.turn(
            q[i, 0], q[i, 1], q[i, 2], q[i, 3],
            Omega[i, 0] * delay, Omega[i, 1] * delay, Omega[i, 2] * delay,
        )  # fmt: skip
        axis = quaternion.third_axis(qw, qx, qy, qz)
        for k in range(3):
            memory[o + _WIND + k] = wind[k]
            memory[o + _MOMENTUM + k] += dt * (
                thrust * axis[k]
                + T[i] * memory[o + _DIRECTION + k]
                + memory[o + _FORCE + k]
                - (m * g if k == 2 else 0.0)
            )
        aim(i, fresh, dt, keep, u, norm, memory, o + _AIM, thrusts, attitudes, rates)


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

    def warnings(self, mission: Mission) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "position_control")

    def params(self, team: Team) -> Vector:
        band = self.bandwidths()
        head = [team.gravity, band.velocity, band.position]
        head += [self.observer * band.position, self.observer_limit, self.lag, self.frequency]
        head += [self.thrust_filter, self.min_thrust, self.max_thrust]
        head += [math.tan(math.radians(self.max_tilt_deg)), self.max_swing]
        head += [self.delay if self.predicted else 0.0, self.max_push]
        return np.concatenate([head, team.masses, team.cable_lengths])

    def memory(self, team: Team) -> Vector:
        return np.zeros(_SLOTS * team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, 0, _SLOTS, places)
