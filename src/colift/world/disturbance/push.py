"""A push: a constant force on the load for a while."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from colift.kernel.jit import kernel
from colift.part import Vector
from colift.team import Team
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

Newton = Annotated[float, Field(ge=-1e6, le=1e6)]


@kernel(SIGNATURE)
def _push(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, dt = now.step, now.dt
    positions = sees.positions
    external = writes.external_forces
    t = step * dt
    if params[3] <= t < params[4]:
        for k in range(3):
            external[positions.shape[0], k] += params[k]


class Push(DisturbancePart):
    """``force`` on the load from ``at`` for ``duration``."""

    kernel = _push

    force: tuple[Newton, Newton, Newton] = (0.0, 0.0, 0.0)
    """World frame, N."""
    at: Annotated[float, Field(ge=0.0)] = 0.0
    """Begin, s."""
    duration: Annotated[float, Field(ge=0.0)] = 1.0
    """s."""

    def params(self, team: Team) -> Vector:
        return np.array([*self.force, self.at, self.at + self.duration])
