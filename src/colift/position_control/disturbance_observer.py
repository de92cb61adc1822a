"""Position control that observes the force of the wind, at gains that the delay allows."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.jit import inline, kernel
from colift.math.small import solve_symmetric
from colift.math.sphere import follow
from colift.part import Places, Vector, carry_rows
from colift.position_control._aim import aim
from colift.position_control.base import SIGNATURE, PositionControlPart
from colift.team import Team
from colift.tuning import Delays

# params: g; velocity and position bandwidth; observer bandwidth, its bound over weight, its lag; frequency of
# the cables; time constant of the thrust's rate; least and most thrust over weight, tangent of the tilt; most
# acceleration for turning a cable.
_HEAD = 12  # then m, L
_AIM = 10  # after started; direction, rate, acceleration (3 each)
_MOMENTUM, _FORCE, _GUESS = 16, 19, 22  # after u_hat and its rate (3 each)
_SLOTS = 25


@inline
def _observe(i, n, v, dt, params, memory, o):  # type: ignore[no-untyped-def]
    """The force that explains the momentum which the known forces do not; bounded, without windup."""
    m = params[_HEAD + i]
    size = 0.0
    for k in range(3):
        if memory[o] == 0.0:
            memory[o + _MOMENTUM + k] = m * v[i, k]
        guess = params[3] * (m * v[i, k] - memory[o + _MOMENTUM + k])
        memory[o + _GUESS + k] = guess
        size += guess * guess
    bound = params[4] * m * params[0]
    if size > bound * bound:
        shrink = bound / math.sqrt(size)
        for k in range(3):
            memory[o + _GUESS + k] *= shrink
            memory[o + _MOMENTUM + k] = m * v[i, k] - memory[o + _GUESS + k] / params[3]


@inline
def _limit(i, u, least, most, tangent):  # type: ignore[no-untyped-def]
    """Clip a wanted thrust vector to what the drone can give; height goes before place."""
    u[i, 2] = min(max(u[i, 2], least), most)
    across = math.sqrt(u[i, 0] * u[i, 0] + u[i, 1] * u[i, 1])
    room = min(tangent * u[i, 2], math.sqrt(max(most * most - u[i, 2] * u[i, 2], 0.0)))
    if across > room:
        u[i, 0] *= room / across
        u[i, 1] *= room / across


@kernel(SIGNATURE)
def _observe_and_control(  # type: ignore[no-untyped-def]
    x, v, reference, T, alpha, dt, params, memory, u, thrusts, attitudes, rates
):
    n = x.shape[0]
    g = params[0]
    keep = math.exp(-dt / params[7]) if params[7] > 0.0 else 0.0
    # The wind is what the drones feel across their cables; along them it cannot be told from tension.
    xx = yy = zz = 1e-6
    xy = xz = yz = bx = by = bz = 0.0
    for i in range(n):
        o = _SLOTS * i
        if memory[o] == 0.0:
            for k in range(3):
                memory[o + 1 + k] = alpha[i, k]
        reach = params[11] / (params[6] * params[6] * params[_HEAD + n + i])
        follow(memory, o + 1, alpha[i, 0], alpha[i, 1], alpha[i, 2], params[6], dt, reach)
        _observe(i, n, v, dt, params, memory, o)
        ax, ay, az = memory[o + 1], memory[o + 2], memory[o + 3]
        dx, dy, dz = memory[o + _GUESS], memory[o + _GUESS + 1], memory[o + _GUESS + 2]
        along = ax * dx + ay * dy + az * dz
        xx, yy, zz = xx + 1.0 - ax * ax, yy + 1.0 - ay * ay, zz + 1.0 - az * az
        xy, xz, yz = xy - ax * ay, xz - ax * az, yz - ay * az
        bx, by, bz = bx + dx - along * ax, by + dy - along * ay, bz + dz - along * az
    wx, wy, wz = solve_symmetric(xx, xy, xz, yy, yz, zz, bx, by, bz)
    for i in range(n):
        o = _SLOTS * i
        m, L = params[_HEAD + i], params[_HEAD + n + i]
        d = o + _GUESS
        missing = (
            memory[o + 1] * (wx - memory[d])
            + memory[o + 2] * (wy - memory[d + 1])
            + memory[o + 3] * (wz - memory[d + 2])
        )
        for k in range(3):
            a = memory[o + 1 + k]
            x_e = x[i, k] - (reference[0, k] - L * a)
            v_e = v[i, k] - (reference[1, k] - L * memory[o + 4 + k])
            acceleration = reference[2, k] - L * memory[o + 7 + k]
            gravity = g if k == 2 else 0.0
            u[i, k] = (
                m * (gravity + acceleration - params[1] * (v_e + params[2] * x_e))
                - T[i] * a
                - (memory[d + k] + missing * a)
            )
        _limit(i, u, m * g * params[8], m * g * params[9], params[10])
        # What will act: the thrust behind the attitude's lag, and the cable.
        follow_up = dt / (dt + params[5])
        for k in range(3):
            thrust = memory[o + _FORCE + k]
            if memory[o] == 0.0:
                thrust = u[i, k]
            memory[o + _FORCE + k] = thrust + follow_up * (u[i, k] - thrust)
            weight = m * g if k == 2 else 0.0
            memory[o + _MOMENTUM + k] += dt * (
                memory[o + _FORCE + k] + T[i] * memory[o + 1 + k] - weight + memory[d + k]
            )
        norm = math.sqrt(u[i, 0] * u[i, 0] + u[i, 1] * u[i, 1] + u[i, 2] * u[i, 2])
        fresh = memory[o] == 0.0
        memory[o] = 1.0
        aim(i, fresh, dt, keep, u, norm, memory, o + _AIM, thrusts, attitudes, rates)


class DisturbanceObserver(PositionControlPart, Delays):
    """Cable motion fed forward, PD gains from the delay, and an observer of the wind instead of an integral.

    A momentum observer per drone (De Luca and Mattone 2003) finds the force that thrust, weight and wanted
    tension do not explain. Only its part across the cable is used as it is: along the cable nobody can tell
    wind from tension, and to integrate there would strain the cables against each other and hide the load's
    true weight. That part is filled in from the wind that all drones feel alike: the force whose parts
    across all cables fit the observations best.
    """

    kernel = _observe_and_control

    observer: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    """Bandwidth of the observer over that of the position loop."""
    observer_limit: Annotated[float, Field(ge=0.0, le=2.0)] = 0.5
    """Bound on the observed force over the drone's weight."""
    frequency: Annotated[float, Field(gt=0.0, le=100.0)] = 5.0
    """Natural frequency of the reference filter on the sphere, rad/s."""
    max_swing: Annotated[float, Field(gt=0.0, le=100.0)] = 4.0
    """Most acceleration that a drone is asked for to turn its cable, m/s^2."""
    thrust_filter: Annotated[float, Field(ge=0.0, le=0.5)] = 0.15
    """Time constant of the derivative of the thrust direction, s."""
    min_thrust: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    """Least vertical thrust over the drone's weight."""
    max_thrust: Annotated[float, Field(gt=1.0, le=20.0)] = 2.5
    """Most thrust over the drone's weight."""
    max_tilt_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 45.0
    """Most tilt, degrees."""

    def params(self, team: Team) -> Vector:
        band = self.bandwidths()
        attitude_lag = 0.5 / band.attitude
        head = [team.gravity, band.velocity, band.position]
        head += [self.observer * band.position, self.observer_limit, attitude_lag, self.frequency]
        head += [self.thrust_filter, self.min_thrust, self.max_thrust]
        head += [math.tan(math.radians(self.max_tilt_deg)), self.max_swing]
        return np.concatenate([head, team.masses, team.cable_lengths])

    def memory(self, team: Team) -> Vector:
        return np.zeros(_SLOTS * team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, 0, _SLOTS, places)
