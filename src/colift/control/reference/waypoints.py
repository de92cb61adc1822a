"""Point to point: rest at each waypoint, smooth straight lines between them."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import rest_to_rest
from colift.part import Vector
from colift.team import Team

LEG = Layout(team={"departure": 1, "travel": 1, "point": 3})
"""Each waypoint's numbers; of the way to it, but for the first."""
L, WIDTH = LEG.at, LEG.size(0)


@kernel(SIGNATURE)
def _waypoints(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    count = params.shape[0] // WIDTH
    leg = 0
    while leg < count - 1 and t >= params[WIDTH * (leg + 1) + L.departure]:
        leg += 1
    here = WIDTH * leg
    for k in range(3):
        for row in range(1, 4):
            reference[row, k] = 0.0
        reference[0, k] = params[here + L.point + k]
    if leg == 0:
        return
    before = here - WIDTH
    travel = params[here + L.travel]
    s0, s1, s2, s3 = rest_to_rest((t - params[here + L.departure]) / travel)
    for k in range(3):
        step = params[here + L.point + k] - params[before + L.point + k]
        reference[0, k] = params[before + L.point + k] + step * s0
        reference[1, k] = step * s1 / travel
        reference[2, k] = step * s2 / (travel * travel)
        reference[3, k] = step * s3 / (travel * travel * travel)


class Waypoints(ReferencePart):
    """Visit ``points`` in turn: hold each for ``hold``, then travel for ``travel`` seconds."""

    kernel = _waypoints

    points: Annotated[
        tuple[tuple[float, float, float], ...], Field(min_length=1, max_length=1000)
    ] = ((0.0, 0.0, 1.0), (2.0, 1.0, 1.5))
    """Waypoints, world frame, m; the load starts at the first."""
    travel: Annotated[float, Field(gt=0.0)] = 4.0
    """Time from one waypoint to the next, s."""
    hold: Annotated[float, Field(ge=0.0)] = 1.0
    """Rest at each waypoint, s."""

    def params(self, team: Team) -> Vector:
        departures = (self.hold * k + self.travel * max(k - 1, 0) for k in range(len(self.points)))
        rows = [
            LEG.pack(0, departure=departure, travel=self.travel, point=point)
            for departure, point in zip(departures, self.points, strict=True)
        ]
        return np.concatenate(rows)
