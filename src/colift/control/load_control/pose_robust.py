"""Place and attitude of a rigid load, robust against what nobody told: ``pose`` with a bounded term that is strong near the wanted attitude.

After the idea of Cai and Xian (2024), who hold a rigid load on cables by a geometric law with a robust integral of the error's sign (RISE; Xian, Dawson, de
Queiroz and Chen, IEEE TAC 2004). With the filtered error ``s = e_W + c e_R`` the moment of ``pose`` gains, in the load's frame::

    M' = mu - rho s / max(|s|, eps),      mu' = -beta s / max(|s|, eps),      |mu| <= most

RISE has the sign of ``s`` under the integral and no bound on it. Here both terms saturate: sampled at 100 Hz behind a delay a sign would chatter, and an
integral without bound winds up while the cables give less than is asked. What that costs and what remains true stands in docs/theory/control.md.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.load_control.base import SIGNATURE
from colift.control.load_control.pose import MEMORY as HELD
from colift.control.load_control.pose import PARAMS as POSE
from colift.control.load_control.pose import Pose, hold_pose, turn_error
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.spans import LINE
from colift.part import Vector
from colift.team import Team
from colift.team.plan import spanned

ROBUST = Layout(
    team={"slope": 1, "axis": 3, "layer": 1, "strong": 1, "beta": 1, "bound": 1, "yaw": 1}
)
"""Parameters behind those of ``pose``; ``axis``: the line through the ends of two cables, about which nobody turns the load."""
PARAMS = Layout(team={**POSE.team, **ROBUST.team})
MEMORY = Layout(team={**HELD.team, "mu": 3})
"""Integral part of the robust moment, N m, in the load's frame."""
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE)
def _pose_robust(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    w, o, mu = sees.estimated_load_rates, P.axis, memory[M.mu : M.mu + 3]
    errors = turn_error(
        sees.estimated_load_attitude, (w[0], w[1], w[2]), sees.reference_attitude, sees.reference_rates
    )  # fmt: skip
    e_R, e_W, _, _ = errors
    c = params[P.slope]
    s = (e_W[0] + c * e_R[0], e_W[1] + c * e_R[1], e_W[2] + c * e_R[2])
    free = s[0] * params[o] + s[1] * params[o + 1] + s[2] * params[o + 2]
    s = (s[0] - free * params[o], s[1] - free * params[o + 1], s[2] - free * params[o + 2])
    size = math.sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2])
    push = (0.0, 0.0, 0.0)
    if size < math.inf:
        share = 1.0 / max(size, params[P.layer])
        if sees.standing[sees.standing.shape[0] - 1] == 0.0:
            for k in range(3):
                mu[k] -= now.dt * params[P.beta] * s[k] * share
        most = math.sqrt(mu[0] * mu[0] + mu[1] * mu[1] + mu[2] * mu[2])
        if most > params[P.bound]:
            for k in range(3):
                mu[k] *= params[P.bound] / most
        share *= params[P.strong]
        push = (mu[0] - share * s[0], mu[1] - share * s[1], mu[2] - params[P.yaw] * share * s[2])
    hold_pose(now.dt, errors, (0.0, 0.0, 0.0), push, sees, params, memory, writes)


class PoseRobust(Pose):
    """``pose`` with a bounded robust moment in place of its integral: for a load that is told wrong, or turned by the wind.

    It learns nothing about the load, and passes nothing on to those who lead the cables: where what is wrong lasts, ``pose-adaptive`` does better once it
    knows it. On two cables it asks for nothing about the line through their ends.
    """

    kernel = _pose_robust
    remembers = MEMORY

    integral: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    """As of ``pose``: the robust integral takes its place."""
    layer_deg: Annotated[float, Field(gt=0.0, le=90.0)] = 2.0
    """Error of the attitude at rest from which on the robust term grows no more, degrees: the boundary layer."""
    robust: Annotated[float, Field(ge=0.0, le=10.0)] = 0.5
    """Moment per angle within the layer, over weight and half the largest edge of the load, as stiff as the cables hold it themselves."""
    robust_integral: Annotated[float, Field(ge=0.0, le=10.0)] = 0.5
    """Moment per angle and second of its integral there, 1/s, likewise; ``most_moment`` bounds it."""
    yaw: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    """Share of ``robust`` about the load's upright axis: tensions turn nothing about it, only cables that have turned, which takes longer."""

    def params(self, team: Team) -> Vector:
        kind, axis = spanned(team)
        slope = self.turn / (2.0 * self.damping) if self.damping > 0.0 else self.turn
        angle = math.radians(self.layer_deg)
        size = np.zeros(3) if team.body is None else team.body.size
        hold = 0.5 * team.load_mass * team.gravity * float(np.max(size))
        own = ROBUST.pack(
            team.n, slope=slope, axis=axis if kind == LINE else np.zeros(3), layer=slope * angle,
            strong=self.robust * hold * angle, beta=self.robust_integral * hold * angle,
            bound=self.most_moment * hold, yaw=self.yaw,
        )  # fmt: skip
        return np.concatenate([super().params(team), own])
