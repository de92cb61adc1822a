"""Stand still at one point."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.math.turning import turn_to
from colift.part import Vector
from colift.team import Team

Angle = Annotated[float, Field(ge=-180.0, le=180.0)]


@kernel(SIGNATURE)
def _hover(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    reference = writes.reference
    for k in range(3):
        reference[0, k] = params[k]
        reference[1, k] = 0.0
        reference[2, k] = 0.0
        reference[3, k] = 0.0
    roll, pitch, yaw = params[3], params[4], params[5]
    if roll != 0.0 or pitch != 0.0 or yaw != 0.0:
        turn_to(
            (roll, 0.0, 0.0, 0.0), (pitch, 0.0, 0.0, 0.0), (yaw, 0.0, 0.0, 0.0),
            writes.reference_attitude, writes.reference_rates,
        )  # fmt: skip


class Hover(ReferencePart):
    """Stand still at one point."""

    kernel = _hover
    turns = ("attitude_deg",)

    position: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Where the load hovers, world frame, m."""
    attitude_deg: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw of a rigid load, degrees: ``Rz(yaw) Ry(pitch) Rx(roll)``."""

    def upright(self) -> Self:
        return self.model_copy(update={"attitude_deg": (0.0, 0.0, self.attitude_deg[2])})

    def params(self, team: Team) -> Vector:
        return np.array([*self.position, *np.radians(self.attitude_deg)])
