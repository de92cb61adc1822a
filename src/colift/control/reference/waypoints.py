"""Point to point: rest at each waypoint, smooth straight lines between them."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import rest_to_rest
from colift.kernel.math.turning import turn_to
from colift.part import Vector
from colift.team import Team

LEG = Layout(team={"departure": 1, "travel": 1, "point": 3, "turned": 3})
"""Each waypoint's numbers, the angles in rad; of the way to it, but for the first."""
L, WIDTH = LEG.at, LEG.size(0)


@inline
def _between(a, b, travel, ramp):  # type: ignore[no-untyped-def]
    """From a to b along a ramp in the share of the travel: value and three time derivatives."""
    step = b - a
    return (
        a + step * ramp[0],
        step * ramp[1] / travel,
        step * ramp[2] / (travel * travel),
        step * ramp[3] / (travel * travel * travel),
    )


@kernel(SIGNATURE)
def _waypoints(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    count = params.shape[0] // WIDTH
    leg = 0
    while leg < count - 1 and t >= params[WIDTH * (leg + 1) + L.departure]:
        leg += 1
    to = WIDTH * leg
    of = max(to - WIDTH, 0)
    travel = params[to + L.travel]
    ramp = rest_to_rest((t - params[to + L.departure]) / travel)
    level = True
    for k in range(3):
        a, b = of + L.point + k, to + L.point + k
        motion = _between(params[a], params[b], travel, ramp)
        for row in range(4):
            writes.reference[row, k] = motion[row]
        level = level and params[of + L.turned + k] == 0.0 and params[to + L.turned + k] == 0.0
    if level:
        return
    a, b = of + L.turned, to + L.turned
    roll = _between(params[a], params[b], travel, ramp)
    pitch = _between(params[a + 1], params[b + 1], travel, ramp)
    yaw = _between(params[a + 2], params[b + 2], travel, ramp)
    turn_to(roll, pitch, yaw, writes.reference_attitude, writes.reference_rates)


Lean = Annotated[float, Field(ge=-60.0, le=60.0)]
Heading = Annotated[float, Field(ge=-3600.0, le=3600.0)]


class Waypoints(ReferencePart):
    """Visit ``points`` in turn: hold each for ``hold``, then travel for ``travel`` seconds."""

    kernel = _waypoints
    turns = ("attitudes_deg",)

    points: Annotated[
        tuple[tuple[float, float, float], ...], Field(min_length=1, max_length=1000)
    ] = ((0.0, 0.0, 1.0), (2.0, 1.0, 1.5))
    """Waypoints, world frame, m; the load starts at the first."""
    attitudes_deg: Annotated[tuple[tuple[Lean, Lean, Heading], ...], Field(max_length=1000)] = ()
    """Roll, pitch and yaw of a rigid load at each of them, degrees: ``Rz(yaw) Ry(pitch) Rx(roll)``; empty: level. Each angle goes from
    number to number as smoothly as the place, so that from 170 to 190 it turns by 20."""
    travel: Annotated[float, Field(gt=0.0)] = 4.0
    """Time from one waypoint to the next, s."""
    hold: Annotated[float, Field(ge=0.0)] = 1.0
    """Rest at each waypoint, s."""

    @model_validator(mode="after")
    def _one_each(self) -> Self:
        if len(self.attitudes_deg) not in (0, len(self.points)):
            raise ValueError(
                f"attitudes_deg has {len(self.attitudes_deg)} attitudes, and must have none or one for each of the {len(self.points)} points"
            )
        return self

    def upright(self) -> Self:
        level = tuple((0.0, 0.0, yaw) for _, _, yaw in self.attitudes_deg)
        return self.model_copy(update={"attitudes_deg": level})

    def params(self, team: Team) -> Vector:
        departures = (self.hold * k + self.travel * max(k - 1, 0) for k in range(len(self.points)))
        attitudes = np.radians(self.attitudes_deg or [(0.0, 0.0, 0.0)] * len(self.points))
        rows = [
            LEG.pack(0, departure=departure, travel=self.travel, point=point, turned=turned)
            for departure, point, turned in zip(departures, self.points, attitudes, strict=True)
        ]
        return np.concatenate(rows)
