"""The paper's position controller: PID to ``x_Ld - L_i alpha_id``, then thrust and attitude."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from colift.control.margins import Places
from colift.control.position_control._aim import AIM, aim
from colift.control.position_control.base import SIGNATURE, PositionControlPart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import decay
from colift.part import Vector
from colift.team import Team

Gain = Annotated[float, Field(ge=0.0)]

PARAMS = Layout(
    team={
        "g": 1, "k_p": 3, "k_d": 3, "k_i": 3, "limit": 1, "direction_filter": 1, "thrust_filter": 1,
        "direction_rates": 1,
    },
    drone={"m": 1, "L": 1},
)  # fmt: skip
MEMORY = Layout(drone={"started": 1, "integral": 3, "alpha": 3, "alpha_rate": 3, "aim": AIM})
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE, counted=False)
def _pid(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    x, v, ends = sees.estimated_positions, sees.estimated_velocities, sees.wanted_ends
    T, alpha = sees.received_tensions, sees.received_directions
    u, thrusts, attitudes = writes.drone_forces, writes.thrusts, writes.desired_attitudes
    rates = writes.desired_rates
    n = x.shape[0]
    g, limit, rates_on = params[P.g], params[P.limit], params[P.direction_rates]
    keep_alpha = decay(dt, params[P.direction_filter])
    keep_u = decay(dt, params[P.thrust_filter])
    for i in range(n):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        m_i, L_i = params[p + P.m], params[p + P.L] + sees.reeled[i, 0]
        fresh = memory[o + M.started] == 0.0
        memory[o + M.started] = 1.0
        S, a, a_dot = o + M.integral, o + M.alpha, o + M.alpha_rate
        norm = 0.0
        for k in range(3):
            # Rate of the wanted direction: first-order filter on the difference quotient.
            if fresh:
                memory[a + k] = alpha[i, k]
            rate = rates_on * (alpha[i, k] - memory[a + k]) / dt
            memory[a_dot + k] = keep_alpha * memory[a_dot + k] + (1.0 - keep_alpha) * rate
            memory[a + k] = alpha[i, k]
            x_e = x[i, k] - (ends[i, 0, k] - L_i * alpha[i, k])
            paid_out = sees.reeled[i, 1] * alpha[i, k]
            v_e = v[i, k] - (ends[i, 1, k] - L_i * memory[a_dot + k]) + paid_out
            memory[S + k] = min(max(memory[S + k] + dt * x_e, -limit), limit)
            gravity = g if k == 2 else 0.0
            # u_i = m_i (g e3 + xdd_Ld) - T_id alpha_id - k_p x_e - k_d xdot_e - k_i int x_e
            u[i, k] = (
                m_i * (gravity + ends[i, 2, k])
                - T[i] * alpha[i, k]
                - params[P.k_p + k] * x_e
                - params[P.k_d + k] * v_e
                - params[P.k_i + k] * memory[S + k]
            )
            norm += u[i, k] * u[i, k]
        aim(i, fresh, dt, keep_u, u, math.sqrt(norm), memory, o + M.aim, thrusts, attitudes, rates)


class Pid(PositionControlPart):
    """Drone position PID with the paper's gains (paper eqs. 8 to 10)."""

    kernel = _pid
    remembers = MEMORY
    gain_setting: ClassVar[str] = "k_d"

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

    def places(self, team: Team, axis: int) -> Places:
        m = float(team.masses.mean())
        k_p, k_d, k_i = self.k_p[axis] / m, self.k_d[axis] / m, self.k_i[axis] / m
        rate = self.direction_filter if self.direction_rates else math.nan
        return Places(k_d, k_p, k_i, rate_filter=rate, thrust_filter=self.thrust_filter)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, g=team.gravity, k_p=self.k_p, k_d=self.k_d, k_i=self.k_i,
            limit=self.integral_limit, direction_filter=self.direction_filter,
            thrust_filter=self.thrust_filter, direction_rates=float(self.direction_rates),
            m=team.masses, L=team.cable_lengths,
        )  # fmt: skip
