"""The paper's position controller with the motion of the cables fed forward."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.jit import kernel
from colift.math.sphere import follow
from colift.part import Places, Vector, carry_rows
from colift.position_control._aim import aim
from colift.position_control.base import SIGNATURE, PositionControlPart
from colift.team import Team

Gain = Annotated[float, Field(ge=0.0)]

_HEAD = 13  # params: g, k_p, k_d, k_i (3 each), limit, frequency, time constant; then m, L
_SLOTS = 19  # memory per drone: started; integral; direction, rate, acceleration; u_hat, its rate (3 each)


@kernel(SIGNATURE)
def _feed_forward(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    x, v, reference = sees.estimated_positions, sees.estimated_velocities, sees.reference
    T, alpha = sees.received_tensions, sees.received_directions
    u, thrusts, attitudes = writes.drone_forces, writes.thrusts, writes.desired_attitudes
    rates = writes.desired_rates
    n = x.shape[0]
    g = params[0]
    limit = params[10]
    keep = math.exp(-dt / params[12]) if params[12] > 0.0 else 0.0
    for i in range(n):
        m_i = params[_HEAD + i]
        L_i = params[_HEAD + n + i]
        fresh = memory[_SLOTS * i] == 0.0
        memory[_SLOTS * i] = 1.0
        o = _SLOTS * i + 1
        a = o + 3
        if fresh:
            for k in range(3):
                memory[a + k] = alpha[i, k]
        follow(memory, a, alpha[i, 0], alpha[i, 1], alpha[i, 2], params[11], dt)
        norm = 0.0
        for k in range(3):
            # The drone's place, velocity and acceleration at the end of the filtered cable.
            x_e = x[i, k] - (reference[0, k] - L_i * memory[a + k])
            v_e = v[i, k] - (reference[1, k] - L_i * memory[a + 3 + k])
            acceleration = reference[2, k] - L_i * memory[a + 6 + k]
            memory[o + k] = min(max(memory[o + k] + dt * x_e, -limit), limit)
            gravity = g if k == 2 else 0.0
            u[i, k] = (
                m_i * (gravity + acceleration)
                - T[i] * memory[a + k]
                - params[1 + k] * x_e
                - params[4 + k] * v_e
                - params[7 + k] * memory[o + k]
            )
            norm += u[i, k] * u[i, k]
        aim(i, fresh, dt, keep, u, math.sqrt(norm), memory, o + 12, thrusts, attitudes, rates)


class FeedForward(PositionControlPart):
    """The paper's PID towards a filtered cable direction whose rate and acceleration are fed forward.

    Goes beyond the paper, which leaves the cable's own acceleration out of ``u_i``.
    """

    kernel = _feed_forward

    k_p: tuple[Gain, Gain, Gain] = (40.0, 40.0, 40.0)
    """Proportional gain per world axis, N/m."""
    k_d: tuple[Gain, Gain, Gain] = (10.0, 10.0, 10.0)
    """Derivative gain, N s/m."""
    k_i: tuple[Gain, Gain, Gain] = (2.0, 2.0, 2.0)
    """Integral gain, N/(m s)."""
    integral_limit: Annotated[float, Field(gt=0.0)] = 1.0
    """Bound on the integral of the error per axis, m s."""
    frequency: Annotated[float, Field(gt=0.0, le=100.0)] = 10.0
    """Natural frequency of the reference filter on the sphere, rad/s."""
    thrust_filter: Annotated[float, Field(ge=0.0, le=0.1)] = 0.003
    """Time constant of the derivative of the thrust direction, s."""

    def params(self, team: Team) -> Vector:
        gains = [team.gravity, *self.k_p, *self.k_d, *self.k_i]
        head = [*gains, self.integral_limit, self.frequency, self.thrust_filter]
        return np.concatenate([head, team.masses, team.cable_lengths])

    def memory(self, team: Team) -> Vector:
        return np.zeros(_SLOTS * team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, 0, _SLOTS, places)
