"""The paper's attitude law: error manifold with a saturated robust term (paper eqs. 11 to 13)."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.control.attitude_control.base import SIGNATURE, AttitudeControlPart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.part import Vector
from colift.team import Team

Gain = Annotated[float, Field(gt=0.0)]

PARAMS = Layout(team={"rho": 3, "K_d": 3, "beta": 3, "gamma": 3})
P = PARAMS.at


@kernel(SIGNATURE, counted=False)
def _manifold(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    q, Omega, q_d = sees.estimated_attitudes, sees.estimated_rates, sees.desired_attitudes
    Omega_d = sees.desired_rates
    tau = writes.torques
    rho, K_d = params[P.rho : P.rho + 3], params[P.K_d : P.K_d + 3]
    beta, gamma = params[P.beta : P.beta + 3], params[P.gamma : P.gamma + 3]
    for i in range(q.shape[0]):
        w, ex, ey, ez = quaternion.multiply(
            q_d[i, 0], -q_d[i, 1], -q_d[i, 2], -q_d[i, 3], q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        )
        # q and -q are one attitude: take the short way round.
        sign = -1.0 if w < 0.0 else 1.0
        q_e = (sign * ex, sign * ey, sign * ez)
        for k in range(3):
            # s_i = Omega_ie + rho_i q_ie;  tau_i = -K_di s_i - beta_i sat(gamma_i s_i)
            s = Omega[i, k] - Omega_d[i, k] + rho[k] * q_e[k]
            saturated = min(max(gamma[k] * s, -1.0), 1.0)
            tau[i, k] = -K_d[k] * s - beta[k] * saturated


class Manifold(AttitudeControlPart):
    """``s = Omega_e + rho q_e``, ``tau = -K_d s - beta sat(gamma s)``; all gains unpublished, chosen."""

    kernel = _manifold
    gain_setting: ClassVar[str] = "k_d"

    rho: tuple[Gain, Gain, Gain] = (40.0, 40.0, 40.0)
    """Slope of the error manifold per body axis, 1/s."""
    k_d: tuple[Gain, Gain, Gain] = (2.0, 2.0, 2.0)
    """Damping gain per body axis, N m s."""
    beta: tuple[Gain, Gain, Gain] = (0.1, 0.1, 0.1)
    """Size of the robust term per body axis, N m."""
    gamma: tuple[Gain, Gain, Gain] = (10.0, 10.0, 10.0)
    """Slope of the saturation, s."""

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(team.n, rho=self.rho, K_d=self.k_d, beta=self.beta, gamma=self.gamma)

    def gains(self, team: Team) -> tuple[Vector, Vector, Vector]:
        robust = np.multiply(self.beta, self.gamma)
        K, extra, rho = (np.tile(each, (team.n, 1)) for each in (self.k_d, robust, self.rho))
        return K, extra, rho
