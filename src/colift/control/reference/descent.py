"""Come down: from a moving start to rest near the ground."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.math.smooth import phase
from colift.part import Vector
from colift.team import Team

Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]


@kernel(SIGNATURE)
def _descent(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t = now.time
    reference = writes.reference
    since, rate, ease, sink, wait = t - params[6], params[7], params[8], params[9], params[10]
    begun = phase(since, ease, 1.0)
    sinks = phase(since - wait, ease, 1.0)
    ended = phase(since - wait - sink, ease, 1.0)
    for order in range(4):
        for k in range(3):
            # The first speed fades as the descent begins; at the end so does the descent.
            reference[order, k] = -params[3 + k] * begun[order]
        reference[order, 2] -= rate * (sinks[order] - ended[order])
    for k in range(3):
        reference[0, k] += params[k] + params[3 + k] * max(since, 0.0)
        reference[1, k] += params[3 + k]


class Descent(ReferencePart):
    """From a point and a speed to a vertical descent, at once or after a rest, then rest at a height; all changes are smooth.

    A flight whose drones cannot carry the load any more goes on with it.
    """

    kernel = _descent

    position: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 2.0)
    """Where it begins, world frame, m."""
    velocity: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    """Speed at that point, m/s."""
    at: Annotated[float, Field(ge=0.0)] = 0.0
    """When it begins, s."""
    rate: Annotated[float, Field(gt=0.0, le=10.0)] = 0.4
    """Speed of descent, m/s."""
    height: Coordinate = 0.1
    """Height at which it ends, m."""
    wait: Annotated[float, Field(ge=0.0, le=1e3)] = 0.0
    """How long it stays where it came to rest before it goes down, s."""
    ease: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    """Time to change speed at the begin and at the end, s."""

    def params(self, team: Team) -> Vector:
        # Smooth changes of speed travel half of their time at the old speed.
        fall = self.position[2] + 0.5 * self.ease * self.velocity[2] - self.height
        sink = max(fall, 0.0) / self.rate
        begin = [*self.position, *self.velocity, self.at]
        return np.array([*begin, self.rate, self.ease, sink, self.wait])
