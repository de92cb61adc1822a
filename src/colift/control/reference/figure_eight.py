"""A figure eight, ramped up smoothly."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import phase, rest_to_rest, sinusoid
from colift.kernel.math.turning import lean_along, times_of_four, turn_to
from colift.part import Vector
from colift.team import Team

PARAMS = Layout(
    team={
        "centre": 3,
        "along": 1,
        "across": 1,
        "up": 1,
        "rate": 1,
        "ramp": 1,
        "roll": 1,
        "pitch": 1,
        "yaw": 1,
        "lean": 2,
    }
)
P = PARAMS.at


@inline
def _wave(amplitude, factor, p):  # type: ignore[no-untyped-def]
    """``amplitude * sin(factor * p)`` and three time derivatives, from those of the phase."""
    sine, cosine = math.sin(factor * p[0]), math.cos(factor * p[0])
    return sinusoid(amplitude, factor, p[0], p[1], p[2], p[3], sine, cosine)


@kernel(SIGNATURE)
def _figure_eight(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    p = phase(t, params[P.ramp], params[P.rate])
    x, y = _wave(params[P.along], 1.0, p), _wave(params[P.across], 2.0, p)
    z = _wave(params[P.up], 1.0, p)
    for k in range(4):
        reference[k, 0] = x[k]
        reference[k, 1] = y[k]
        reference[k, 2] = z[k]
    for k in range(3):
        reference[0, k] += params[k]
    if params[P.lean] != 0.0 or params[P.lean + 1] != 0.0:
        s0, s1, s2, s3 = rest_to_rest(t / params[P.ramp])
        rate = 1.0 / params[P.ramp]
        grown = (s0, s1 * rate, s2 * rate * rate, s3 * rate * rate * rate)
        roll, pitch = lean_along(
            times_of_four(grown, _wave(params[P.lean], 1.0, p)),
            times_of_four(grown, _wave(params[P.lean + 1], 2.0, p)),
        )
        still = (0.0, 0.0, 0.0, 0.0)
        turn_to(roll, pitch, still, writes.reference_attitude, writes.reference_rates)
    elif params[P.roll] != 0.0 or params[P.pitch] != 0.0 or params[P.yaw] != 0.0:
        roll, pitch = _wave(params[P.roll], 1.0, p), _wave(params[P.pitch], 2.0, p)
        yaw = _wave(params[P.yaw], 1.0, p)
        turn_to(roll, pitch, yaw, writes.reference_attitude, writes.reference_rates)


class FigureEight(ReferencePart):
    """``x = length sin p``, ``y = width sin 2p``, ``z = height sin p`` about ``centre``; starts at rest at the centre."""

    kernel = _figure_eight
    turns = ("roll_deg", "pitch_deg", "yaw_deg", "lean")

    centre: tuple[float, float, float] = (0.0, 0.0, 1.5)
    """Crossing point, world frame, m."""
    length: Annotated[float, Field(ge=0.0, le=1e4)] = 1.5
    """Half of the extent along x, m."""
    width: Annotated[float, Field(ge=0.0, le=1e4)] = 0.75
    """Half of the extent along y, m."""
    height: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0
    """Half of the extent upwards, m: one end of the eight is higher than the other."""
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
    lean: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Share of the acceleration with which a rigid load leans: at 1 its third axis points along the force that the eight asks for
    after the ramp, over which the lean grows. Instead of the three angles, not beside them."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.lean and (self.roll_deg or self.pitch_deg or self.yaw_deg):
            raise ValueError(
                f"lean = {self.lean:g} says the attitude: roll_deg, pitch_deg and yaw_deg must be 0 beside it"
            )
        return self

    def upright(self) -> Self:
        return self.model_copy(update={"roll_deg": 0.0, "pitch_deg": 0.0, "lean": 0.0})

    def params(self, team: Team) -> Vector:
        rate = 2.0 * np.pi / self.period
        lean = -self.lean * rate * rate / max(team.gravity, 1e-3)
        return PARAMS.pack(
            team.n, centre=self.centre, along=self.length, across=self.width, up=self.height, rate=rate, ramp=self.ramp,
            roll=math.radians(self.roll_deg), pitch=math.radians(self.pitch_deg), yaw=math.radians(self.yaw_deg),
            lean=(lean * self.length, 4.0 * lean * self.width),
        )  # fmt: skip
