"""A steady wind."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import rest_to_rest
from colift.part import Vector
from colift.team import Team
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

Speed = Annotated[float, Field(ge=-60.0, le=60.0)]

PARAMS = Layout(team={"velocity": 3, "ramp": 1})
P = PARAMS.at


@kernel(SIGNATURE)
def _blow(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, dt = now.step, now.dt
    wind = writes.wind
    t = step * dt
    share = 1.0
    if t < params[P.ramp]:
        share = rest_to_rest(t / params[P.ramp])[0]
    for k in range(3):
        wind[k] += share * params[P.velocity + k]


class Wind(DisturbancePart):
    """The same wind everywhere, from calm at the start of the flight; it acts through ``drag``."""

    kernel = _blow
    makes_wind: ClassVar[bool] = True
    steady = True

    speed: Annotated[float, Field(ge=0.0, le=60.0)] = 5.0
    """Horizontal speed, m/s."""
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Where it blows to, degrees from x towards y."""
    updraft: Speed = 0.0
    """Vertical speed, m/s."""
    ramp: Annotated[float, Field(ge=0.0, le=1e3)] = 2.0
    """Time in which it rises to its full speed, s."""

    def strongest_wind(self) -> Vector:
        heading = math.radians(self.heading_deg)
        level = [self.speed * math.cos(heading), self.speed * math.sin(heading)]
        return np.array([*level, self.updraft])

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(team.n, velocity=self.strongest_wind(), ramp=self.ramp)
