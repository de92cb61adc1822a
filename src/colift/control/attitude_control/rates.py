"""Rates alone: torques that bring the wanted body rates about; nobody asks for an attitude."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from colift.control.attitude_control.base import SIGNATURE, AttitudeControlPart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team

PARAMS = Layout(team={"bandwidth": 3}, drone={"J": 3})
P = PARAMS.at


@kernel(SIGNATURE, counted=False)
def _rates(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    Omega, Omega_d, tau = sees.estimated_rates, sees.desired_rates, writes.torques
    for i in range(Omega.shape[0]):
        o = P.rows + P.width * i + P.J
        p, q, r = Omega[i, 0], Omega[i, 1], Omega[i, 2]
        jx, jy, jz = params[o], params[o + 1], params[o + 2]
        # tau_i = -b J (Omega - Omega_d) + Omega x J Omega
        tau[i, 0] = params[P.bandwidth] * jx * (Omega_d[i, 0] - p) + (jz - jy) * q * r
        tau[i, 1] = params[P.bandwidth + 1] * jy * (Omega_d[i, 1] - q) + (jx - jz) * r * p
        tau[i, 2] = params[P.bandwidth + 2] * jz * (Omega_d[i, 2] - r) + (jy - jx) * p * q


class Rates(AttitudeControlPart):
    """``tau = -b J (Omega - Omega_d) + Omega x J Omega``: a rate loop, for whoever commands rates (``position_control.kind = "external"``)."""

    kernel = _rates

    bandwidth: tuple[
        Annotated[float, Field(gt=0.0, le=1e3)],
        Annotated[float, Field(gt=0.0, le=1e3)],
        Annotated[float, Field(gt=0.0, le=1e3)],
    ] = (40.0, 40.0, 15.0)
    """Of each body axis, 1/s."""

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(team.n, bandwidth=self.bandwidth, J=team.inertias)
