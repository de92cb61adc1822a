"""A horizontal figure eight, ramped up smoothly."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import phase, sinusoid
from colift.kernel.math.turning import turn_to
from colift.part import Vector
from colift.team import Team

PARAMS = Layout(
    team={
        "centre": 3,
        "along": 1,
        "across": 1,
        "rate": 1,
        "ramp": 1,
        "roll": 1,
        "pitch": 1,
        "yaw": 1,
    }
)
P = PARAMS.at


@kernel(SIGNATURE)
def _figure_eight(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    p0, p1, p2, p3 = phase(t, params[P.ramp], params[P.rate])
    x = sinusoid(params[P.along], 1.0, p0, p1, p2, p3, math.sin(p0), math.cos(p0))
    y = sinusoid(params[P.across], 2.0, p0, p1, p2, p3, math.sin(2.0 * p0), math.cos(2.0 * p0))
    for k in range(4):
        reference[k, 0] = x[k]
        reference[k, 1] = y[k]
        reference[k, 2] = 0.0
    for k in range(3):
        reference[0, k] += params[k]
    if params[P.roll] != 0.0 or params[P.pitch] != 0.0 or params[P.yaw] != 0.0:
        sine, cosine = math.sin(p0), math.cos(p0)
        roll = sinusoid(params[P.roll], 1.0, p0, p1, p2, p3, sine, cosine)
        pitch = sinusoid(
            params[P.pitch], 2.0, p0, p1, p2, p3, math.sin(2.0 * p0), math.cos(2.0 * p0)
        )
        yaw = sinusoid(params[P.yaw], 1.0, p0, p1, p2, p3, sine, cosine)
        turn_to(roll, pitch, yaw, writes.reference_attitude, writes.reference_rates)


class FigureEight(ReferencePart):
    """``x = length sin p``, ``y = width sin 2p`` about ``centre``; starts at rest at the centre."""

    kernel = _figure_eight
    turns = ("roll_deg", "pitch_deg", "yaw_deg")

    centre: tuple[float, float, float] = (0.0, 0.0, 1.5)
    """Crossing point, world frame, m."""
    length: Annotated[float, Field(ge=0.0, le=1e4)] = 1.5
    """Half of the extent along x, m."""
    width: Annotated[float, Field(ge=0.0, le=1e4)] = 0.75
    """Half of the extent along y, m."""
    period: Annotated[float, Field(gt=0.0)] = 8.0
    """Time of one eight after the ramp, s."""
    ramp: Annotated[float, Field(gt=0.0)] = 3.0
    """Time in which the motion comes up to speed, s."""
    roll_deg: Annotated[float, Field(ge=-60.0, le=60.0)] = 0.0
    """Largest roll of a rigid load, once in each eight to either side, degrees."""
    pitch_deg: Annotated[float, Field(ge=-60.0, le=60.0)] = 0.0
    """Largest pitch, twice in each eight, degrees."""
    yaw_deg: Annotated[float, Field(ge=-170.0, le=170.0)] = 0.0
    """Largest yaw, once in each eight, degrees."""

    def upright(self) -> Self:
        return self.model_copy(update={"roll_deg": 0.0, "pitch_deg": 0.0})

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, centre=self.centre, along=self.length, across=self.width,
            rate=2.0 * np.pi / self.period, ramp=self.ramp, roll=math.radians(self.roll_deg),
            pitch=math.radians(self.pitch_deg), yaw=math.radians(self.yaw_deg),
        )  # fmt: skip
