"""The paper's ascending spiral: a horizontal circle while the height grows, ramped up smoothly."""

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


@kernel(SIGNATURE, counted=False)
def _spiral(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    radius, rate, climb_rate, ramp = params[3], params[4], params[5], params[6]
    p0, p1, p2, p3 = phase(t, ramp, rate)
    s, c = math.sin(p0), math.cos(p0)
    x = sinusoid(radius, 1.0, p0, p1, p2, p3, c, -s)
    y = sinusoid(radius, 1.0, p0, p1, p2, p3, s, c)
    z = phase(t, ramp, climb_rate)
    for k in range(4):
        reference[k, 0] = x[k]
        reference[k, 1] = y[k]
        reference[k, 2] = z[k]
    for k in range(3):
        reference[0, k] += params[k]


class Spiral(ReferencePart):
    """Circle of ``radius`` about ``centre`` with a steady climb; starts at rest at ``centre + (radius, 0, 0)``."""

    kernel = _spiral

    centre: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Centre of the circle at the start, world frame, m."""
    radius: Annotated[float, Field(ge=0.0, le=1e4)] = 1.0
    """m."""
    period: Annotated[float, Field(gt=0.0)] = 10.0
    """Time of one turn after the ramp, s."""
    climb_rate: float = 0.1
    """Upward speed after the ramp, m/s."""
    ramp: Annotated[float, Field(gt=0.0)] = 2.0
    """Time in which the motion comes up to speed, s."""

    def params(self, team: Team) -> Vector:
        rate = 2.0 * np.pi / self.period
        return np.array([*self.centre, self.radius, rate, self.climb_rate, self.ramp])
