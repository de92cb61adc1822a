"""A horizontal figure eight, ramped up smoothly."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.math.smooth import phase, sinusoid
from colift.part import Vector
from colift.team import Team


@kernel(SIGNATURE)
def _figure_eight(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    p0, p1, p2, p3 = phase(t, params[6], params[5])
    x = sinusoid(params[3], 1.0, p0, p1, p2, p3, math.sin(p0), math.cos(p0))
    y = sinusoid(params[4], 2.0, p0, p1, p2, p3, math.sin(2.0 * p0), math.cos(2.0 * p0))
    for k in range(4):
        reference[k, 0] = x[k]
        reference[k, 1] = y[k]
        reference[k, 2] = 0.0
    for k in range(3):
        reference[0, k] += params[k]


class FigureEight(ReferencePart):
    """``x = length sin p``, ``y = width sin 2p`` about ``centre``; starts at rest at the centre."""

    kernel = _figure_eight

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

    def params(self, team: Team) -> Vector:
        rate = 2.0 * np.pi / self.period
        return np.array([*self.centre, self.length, self.width, rate, self.ramp])
