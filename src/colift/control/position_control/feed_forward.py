"""The paper's position controller with the motion of the cables fed forward."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from colift.control.margins import Places
from colift.control.position_control._aim import AIM, aim
from colift.control.position_control._cable import CABLE, lead
from colift.control.position_control.base import SIGNATURE, PositionControlPart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import decay
from colift.part import Vector
from colift.team import Team

Gain = Annotated[float, Field(ge=0.0)]

PARAMS = Layout(
    team={"g": 1, "k_p": 3, "k_d": 3, "k_i": 3, "limit": 1, "frequency": 1, "thrust_filter": 1},
    drone={"m": 1, "L": 1},
)
MEMORY = Layout(drone={"started": 1, "integral": 3, "alpha": CABLE, "aim": AIM})
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE)
def _feed_forward(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    x, v, ends = sees.estimated_positions, sees.estimated_velocities, sees.wanted_ends
    T, alpha = sees.received_tensions, sees.received_directions
    u, thrusts, attitudes = writes.drone_forces, writes.thrusts, writes.desired_attitudes
    rates = writes.desired_rates
    reeled, n = sees.reeled, x.shape[0]
    g, limit = params[P.g], params[P.limit]
    keep = decay(dt, params[P.thrust_filter])
    for i in range(n):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        m_i, L_i = params[p + P.m], params[p + P.L] + reeled[i, 0]
        fresh = memory[o + M.started] == 0.0
        memory[o + M.started] = 1.0
        S, a = o + M.integral, o + M.alpha
        if fresh:
            for k in range(3):
                memory[a + k] = alpha[i, k]
        lead(i, alpha, sees.nominal_forces, params[P.frequency], dt, memory, a, math.pi)
        norm = 0.0
        for k in range(3):
            # The drone's place, velocity and acceleration at the end of the filtered cable.
            x_e = x[i, k] - (ends[i, 0, k] - L_i * memory[a + k])
            v_e = v[i, k] - (ends[i, 1, k] - L_i * memory[a + 3 + k]) + reeled[i, 1] * memory[a + k]
            acceleration = ends[i, 2, k] - L_i * memory[a + 6 + k]
            acceleration -= 2.0 * reeled[i, 1] * memory[a + 3 + k] + reeled[i, 2] * memory[a + k]
            memory[S + k] = min(max(memory[S + k] + dt * x_e, -limit), limit)
            gravity = g if k == 2 else 0.0
            u[i, k] = (
                m_i * (gravity + acceleration)
                - T[i] * memory[a + k]
                - params[P.k_p + k] * x_e
                - params[P.k_d + k] * v_e
                - params[P.k_i + k] * memory[S + k]
            )
            norm += u[i, k] * u[i, k]
        aim(i, fresh, dt, keep, u, math.sqrt(norm), memory, o + M.aim, thrusts, attitudes, rates)


class FeedForward(PositionControlPart):
    """The paper's PID towards a filtered cable direction whose rate and acceleration are fed forward.

    Goes beyond the paper, which leaves the cable's own acceleration out of ``u_i``.
    """

    kernel = _feed_forward
    remembers = MEMORY
    gain_setting: ClassVar[str] = "k_d"

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

    def places(self, team: Team, axis: int) -> Places:
        m = float(team.masses.mean())
        k_p, k_d, k_i = self.k_p[axis] / m, self.k_d[axis] / m, self.k_i[axis] / m
        return Places(k_d, k_p, k_i, lead=self.frequency, thrust_filter=self.thrust_filter)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, g=team.gravity, k_p=self.k_p, k_d=self.k_d, k_i=self.k_i,
            limit=self.integral_limit, frequency=self.frequency, thrust_filter=self.thrust_filter,
            m=team.masses, L=team.cable_lengths,
        )  # fmt: skip
