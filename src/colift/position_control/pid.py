"""The paper's position controller: PID to ``x_Ld - L_i alpha_id``, then thrust and attitude."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.jit import kernel
from colift.part import Places, Vector, carry_rows
from colift.position_control._aim import aim
from colift.position_control.base import SIGNATURE, PositionControlPart
from colift.team import Team

Gain = Annotated[float, Field(ge=0.0)]

_HEAD = 14  # params: g, k_p, k_d, k_i (3 each), limit, two time constants, rates on; then m, L
_SLOTS = 16  # memory per drone: started; integral, alpha, alpha rate, u_hat, u_hat rate (3 each)


@kernel(SIGNATURE)
def _pid(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    x, v, reference = sees.estimated_positions, sees.estimated_velocities, sees.reference
    T, alpha = sees.received_tensions, sees.received_directions
    u, thrusts, attitudes = writes.drone_forces, writes.thrusts, writes.desired_attitudes
    rates = writes.desired_rates
    n = x.shape[0]
    g = params[0]
    limit = params[10]
    keep_alpha = math.exp(-dt / params[11]) if params[11] > 0.0 else 0.0
    keep_u = math.exp(-dt / params[12]) if params[12] > 0.0 else 0.0
    rates_on = params[13]
    for i in range(n):
        m_i = params[_HEAD + i]
        L_i = params[_HEAD + n + i]
        fresh = memory[_SLOTS * i] == 0.0
        memory[_SLOTS * i] = 1.0
        o = _SLOTS * i + 1
        norm = 0.0
        for k in range(3):
            # Rate of the wanted direction: first-order filter on the difference quotient.
            if fresh:
                memory[o + 3 + k] = alpha[i, k]
            rate = rates_on * (alpha[i, k] - memory[o + 3 + k]) / dt
            memory[o + 6 + k] = keep_alpha * memory[o + 6 + k] + (1.0 - keep_alpha) * rate
            memory[o + 3 + k] = alpha[i, k]
            x_e = x[i, k] - (reference[0, k] - L_i * alpha[i, k])
            v_e = v[i, k] - (reference[1, k] - L_i * memory[o + 6 + k])
            memory[o + k] = min(max(memory[o + k] + dt * x_e, -limit), limit)
            gravity = g if k == 2 else 0.0
            # u_i = m_i (g e3 + xdd_Ld) - T_id alpha_id - k_p x_e - k_d xdot_e - k_i int x_e
            u[i, k] = (
                m_i * (gravity + reference[2, k])
                - T[i] * alpha[i, k]
                - params[1 + k] * x_e
                - params[4 + k] * v_e
                - params[7 + k] * memory[o + k]
            )
            norm += u[i, k] * u[i, k]
        aim(i, fresh, dt, keep_u, u, math.sqrt(norm), memory, o + 9, thrusts, attitudes, rates)


class Pid(PositionControlPart):
    """Drone position PID with the paper's gains (paper eqs. 8 to 10)."""

    kernel = _pid

    k_p: tuple[Gain, Gain, Gain] = (40.0, 40.0, 40.0)
    """Proportional gain per world axis, N/m (paper: 40)."""
    k_d: tuple[Gain, Gain, Gain] = (10.0, 10.0, 10.0)
    """Derivative gain, N s/m (paper: 10)."""
    k_i: tuple[Gain, Gain, Gain] = (2.0, 2.0, 2.0)
    """Integral gain, N/(m s) (paper: 2)."""
    integral_limit: Annotated[float, Field(gt=0.0)] = 1.0
    """Bound on the integral of the error per axis, m s."""
    direction_filter: Annotated[float, Field(ge=0.0, le=10.0)] = 0.3
    """Time constant of the derivative of the wanted cable directions, s (unpublished; chosen).

    Much below 0.2 s the loop from load error over direction to drone velocity is unstable."""
    thrust_filter: Annotated[float, Field(ge=0.0, le=0.1)] = 0.003
    """Time constant of the derivative of the thrust direction, s (unpublished; chosen)."""
    direction_rates: bool = True
    """Include the wanted cable directions' rates in the drones' wanted velocities."""

    def params(self, team: Team) -> Vector:
        head = [
            team.gravity,
            *self.k_p,
            *self.k_d,
            *self.k_i,
            self.integral_limit,
            self.direction_filter,
            self.thrust_filter,
            float(self.direction_rates),
        ]
        return np.concatenate([head, team.masses, team.cable_lengths])

    def memory(self, team: Team) -> Vector:
        return np.zeros(_SLOTS * team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, 0, _SLOTS, places)
