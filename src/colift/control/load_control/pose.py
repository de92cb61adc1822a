"""Place and attitude of a rigid load: a geometric PID on SE(3) beside the feed-forward of its motion.

After Lee, Leok and McClamroch (CDC 2010), with the force at the centre of mass ``c``::

    F = m (g e3 + a_d) - f - K_p e_x - K_d e_v,        e_x = (x + R c) - (x_d + R_d c),  a_d of that point
    M = Omega x J Omega - J (Omega x R^T R_d Omega_d - R^T R_d Omega_d') - K_R e_R - K_W e_W - K_I int e_R
    e_R = 1/2 (R_d^T R - R^T R_d)^v,                   e_W = Omega - R^T R_d Omega_d

``f`` is what observers make of the force on the load. The gains are frequencies: ``K_R = J w^2``, ``K_W = 2 zeta J w``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.load_control._upright import keep_upright
from colift.control.load_control.base import SIGNATURE, LoadControlPart
from colift.control.tuning import Delays, sway
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.small import cross, matrix_times
from colift.kernel.math.smooth import decay
from colift.part import Setup, Vector
from colift.team import Team

PARAMS = Layout(
    team={
        "m": 1, "g": 1, "rate": 1, "tangent": 1, "k_p": 1, "k_d": 1, "k_R": 1, "k_W": 1, "k_I": 1,
        "J": 9, "centre": 3, "most": 1,
    }
)  # fmt: skip
MEMORY = Layout(team={"push": 3, "moment": 3})
"""Filtered external force on the load, N; integral part of the moment, in its frame, N m."""
P, M = PARAMS.at, MEMORY.at


MOST_ERROR = 0.03
"""Error of the attitude, rad, beyond which it is integrated no faster: what it takes to come back from afar is not learned."""


@inline
def turn_error(q, Omega, q_d, w_d):  # type: ignore[no-untyped-def]
    """Errors ``e_R`` and ``e_W``, wanted rates and their derivative, all in the frame of the load as it is."""
    # E = R^T R_d.
    ew, ex, ey, ez = quaternion.multiply(
        q[0], -q[1], -q[2], -q[3], q_d[0], q_d[1], q_d[2], q_d[3]
    )  # fmt: skip
    wanted = quaternion.into_world(ew, ex, ey, ez, w_d[0, 0], w_d[0, 1], w_d[0, 2])
    tx, ty, tz = quaternion.into_world(ew, ex, ey, ez, w_d[1, 0], w_d[1, 1], w_d[1, 2])
    # 1/2 (R_d^T R - R^T R_d)^v is the imaginary part of E, times -2 ew: the sine of the angle along the axis.
    e_R = (-2.0 * ew * ex, -2.0 * ew * ey, -2.0 * ew * ez)
    e_W = (Omega[0] - wanted[0], Omega[1] - wanted[1], Omega[2] - wanted[2])
    cx, cy, cz = cross(Omega, wanted)
    return e_R, e_W, wanted, (tx - cx, ty - cy, tz - cz)


@inline
def hold_pose(dt, errors, force, moment, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """The law with the ``errors`` of :func:`turn_error`, where what is learned needs more force (world) and moment (load's frame)."""
    load, reference, forces, u_L = (
        sees.estimated_load,
        sees.reference,
        sees.estimated_forces,
        writes.force,
    )
    q, w = sees.estimated_load_attitude, sees.estimated_load_rates
    q_d, w_d = sees.reference_attitude, sees.reference_rates
    m, g, last = params[P.m], params[P.g], sees.estimated_forces.shape[0] - 1
    c = (params[P.centre], params[P.centre + 1], params[P.centre + 2])
    Omega = (w[0], w[1], w[2])
    e_R, e_W, _, acceleration = errors
    J = P.J
    gyration = cross(Omega, matrix_times(J, params, Omega))
    ahead = matrix_times(J, params, acceleration)
    turn = matrix_times(J, params, e_R)
    spin = matrix_times(J, params, e_W)
    stands = sees.standing[last] != 0.0
    M_L, steady = writes.moment, writes.steady_moment
    for k in range(3):
        S = M.moment + k
        if not stands:
            memory[S] -= dt * params[P.k_I] * min(max(e_R[k], -MOST_ERROR), MOST_ERROR)
        memory[S] = min(max(memory[S], -params[P.most]), params[P.most])
        M_L[k] = gyration[k] + ahead[k] - params[P.k_R] * turn[k] - params[P.k_W] * spin[k]
        M_L[k] += memory[S] + moment[k]
        steady[k] = memory[S] + moment[k]
    M_L[0], M_L[1], M_L[2] = quaternion.into_world(
        q[0], q[1], q[2], q[3], M_L[0], M_L[1], M_L[2]
    )  # fmt: skip
    steady[0], steady[1], steady[2] = quaternion.into_world(
        q[0], q[1], q[2], q[3], steady[0], steady[1], steady[2]
    )

    # The centre of mass, as it is and as it should be.
    at = quaternion.into_world(q[0], q[1], q[2], q[3], c[0], c[1], c[2])
    flow = cross(Omega, c)
    speed = quaternion.into_world(q[0], q[1], q[2], q[3], flow[0], flow[1], flow[2])
    at_d = quaternion.into_world(q_d[0], q_d[1], q_d[2], q_d[3], c[0], c[1], c[2])
    o, o1 = (w_d[0, 0], w_d[0, 1], w_d[0, 2]), (w_d[1, 0], w_d[1, 1], w_d[1, 2])
    flow_d = cross(o, c)
    speed_d = quaternion.into_world(q_d[0], q_d[1], q_d[2], q_d[3], flow_d[0], flow_d[1], flow_d[2])
    bend, twist = cross(o, flow_d), cross(o1, c)
    motion = quaternion.into_world(
        q_d[0], q_d[1], q_d[2], q_d[3], bend[0] + twist[0], bend[1] + twist[1], bend[2] + twist[2]
    )  # fmt: skip
    share = 1.0 if stands else 1.0 - decay(dt, 1.0 / params[P.rate])
    for k in range(3):
        memory[M.push + k] += share * (forces[last, k] + force[k] - memory[M.push + k])
        planned = m * (reference[2, k] + motion[k] + (g if k == 2 else 0.0)) + force[k]
        planned -= memory[M.push + k]
        e_x = load[0, k] + at[k] - reference[0, k] - at_d[k]
        e_v = load[1, k] + speed[k] - reference[1, k] - speed_d[k]
        writes.steady_force[k] = planned
        u_L[k] = planned - params[P.k_p] * e_x - params[P.k_d] * e_v
    keep_upright(m * g, params[P.tangent], u_L)


@kernel(SIGNATURE)
def _pose(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    w = sees.estimated_load_rates
    errors = turn_error(
        sees.estimated_load_attitude, (w[0], w[1], w[2]), sees.reference_attitude, sees.reference_rates
    )  # fmt: skip
    none = (0.0, 0.0, 0.0)
    hold_pose(now.dt, errors, none, none, sees, params, memory, writes)


class Pose(LoadControlPart, Delays):
    """A rigid load's place and attitude: feed-forward of its motion, geometric PID of its attitude.

    A point has no attitude: of it no moment is wanted. The place is held by the formation of the drones (position control of kind ``formation``); ``place`` adds feedback of its own.
    """

    kernel = _pose
    remembers = MEMORY
    turns = True

    place: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    """Natural frequency of the feedback of the place, rad/s; critically damped."""
    turn: Annotated[float, Field(ge=0.0, le=50.0)] = 3.0
    """Natural frequency of the feedback of the attitude, rad/s."""
    damping: Annotated[float, Field(ge=0.0, le=5.0)] = 1.0
    """Its damping ratio."""
    integral: Annotated[float, Field(ge=0.0, le=5.0)] = 0.3
    """Rate at which a lasting error of the attitude is integrated, 1/s: moment per angle and second, over weight and half the
    largest edge of the load, as stiff as the cables hold it themselves. 0: not at all."""
    most_moment: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    """Bound on the integral, over weight and half the largest edge of the load."""
    rate: Annotated[float, Field(gt=0.0, le=5.0)] = 0.45
    """How fast the observed force is followed, over the bandwidth of the velocity loop."""
    max_lean_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 60.0
    """Most lean of the wanted force from the vertical, degrees."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "load_control")
        team = mission.team
        if team.body is not None and team.n < 3:
            free = "no attitude" if team.n == 1 else "no turn about the line through their ends"
            message = f"wants an attitude, and {team.n} cable{'s' * (team.n > 1)} hold {free}: there the load swings freely"
            yield "kind", message

    def params(self, team: Team) -> Vector:
        body = team.body
        inertia, centre, size = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
        if body is not None:
            inertia, centre, size = body.inertia, body.centre, body.size
        rate = min(self.rate * self.bandwidths(team).velocity, sway(team))
        w, hold = self.turn, 0.5 * team.load_mass * team.gravity * float(np.max(size))
        return PARAMS.pack(
            team.n, m=team.load_mass, g=team.gravity, rate=rate,
            tangent=math.tan(math.radians(self.max_lean_deg)),
            k_p=team.load_mass * self.place**2, k_d=2.0 * team.load_mass * self.place,
            k_R=w * w, k_W=2.0 * self.damping * w, k_I=self.integral * hold,
            J=inertia.ravel(), centre=centre,
            most=self.most_moment * hold,
        )  # fmt: skip
