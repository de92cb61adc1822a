"""Equal shares plus internal forces that add up to nothing (Tognon et al. 2018)."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.allocation.base import SIGNATURE, AllocatorPart, Status
from colift.control.allocation.common.share import balance, begin, effort
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.rounding import NO_TENSION
from colift.part import Vector
from colift.team import Team

_CONVERGED = int(Status.CONVERGED)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)

PARAMS = Layout(team={"internal": 1, "settling": 1}, drone={"aim": 2})
MEMORY = Layout(drone={"spread": 2})
"""Horizontal parts of the spread ``d_i``, and where they go."""
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """Cable forces on the load ``F/n + t_L d_i``; the spread ``d`` follows its aim and adds up to 0."""
    dt = now.dt
    force = sees.force
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    internal, settling = params[P.internal], params[P.settling]
    W = begin(force, tensions, info)
    if not math.isfinite(W):
        return _INVALID_FORCE
    follow = dt / (settling + dt) if dt > 0.0 else 0.0
    mx = my = 0.0
    for i in range(n):
        d, aim = M.rows + M.width * i + M.spread, P.rows + P.width * i + P.aim
        for k in range(2):
            memory[d + k] += follow * (params[aim + k] - memory[d + k])
        mx += memory[d] / n
        my += memory[d + 1] / n
    for i in range(n):
        d = M.rows + M.width * i + M.spread
        memory[d] -= mx
        memory[d + 1] -= my
    if W == 0.0:
        return _ZERO_FORCE
    for i in range(n):
        d = M.rows + M.width * i + M.spread
        x = -force[0] / n - internal * memory[d]
        y = -force[1] / n - internal * memory[d + 1]
        z = -force[2] / n
        tensions[i] = math.sqrt(x * x + y * y + z * z)
        if tensions[i] > NO_TENSION * W:
            directions[i, 0] = x / tensions[i]
            directions[i, 1] = y / tensions[i]
            directions[i, 2] = z / tensions[i]
    effort(W, tensions, info)
    balance(force, tensions, directions, info)
    return _CONVERGED


class InternalForce(AllocatorPart):
    """Cable ``i`` pulls the load with ``F/n + t_L d_i``, where ``sum_i d_i = 0``.

    Tognon, Gabellieri, Pallottino and Franchi, "Aerial Co-Manipulation with Cables: The Role of
    Internal Force for Equilibria, Stability, and Passivity", IEEE RA-L 3(3), 2018: two robots share a
    beam's weight and pull its ends apart with the internal force ``t_L > 0`` along the beam. For a point
    load with n cables this part generalises it: ``d_i`` are unit vectors in the horizontal plane at equal
    azimuths, in the null space of the force map; two cables give the paper's pair, its beam along
    ``heading_deg``. With ``internal_force = 0`` all cables are parallel, the least norm over free cable
    forces. After a drone is lost the spread is made to add up to nothing at once, and turns to equal
    azimuths within ``settling``.
    """

    kernel = _allocate
    remembers = MEMORY
    spread_setting = ("internal_force", (0.1, 0.2, 0.4, 0.7, 1.0))

    internal_force: Annotated[float, Field(ge=0.0, le=1e6)] = 0.4
    """Internal force ``t_L`` of each cable, N."""
    heading_deg: float = 0.0
    """Azimuth of the first drone, degrees."""
    settling: Annotated[float, Field(ge=0.0, le=60.0)] = 0.5
    """Time in which the spread closes the gap that a lost drone leaves, s."""

    def spread(self, n: int) -> NDArray[np.float64]:
        """Horizontal directions ``d`` (n, 2) of the internal forces on the load, at equal azimuths."""
        azimuth = math.radians(self.heading_deg) + 2.0 * np.pi * np.arange(n) / n
        return np.column_stack([np.cos(azimuth), np.sin(azimuth)]) * (n > 1)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, internal=self.internal_force, settling=self.settling, aim=self.spread(team.n)
        )

    def memory(self, team: Team) -> Vector:
        return MEMORY.pack(team.n, spread=self.spread(team.n))

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        return float(0.5 * tensions @ tensions)
