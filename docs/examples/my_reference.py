"""A reference of your own: the load swings up and down."""

import math
from typing import Annotated

from pydantic import Field

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout

PARAMS = Layout(team={"height": 1, "amplitude": 1, "rate": 1})
P = PARAMS.at


@kernel(SIGNATURE)
def bob(now, sees, params, memory, writes):
    t, reference = now.time, writes.reference
    height, amplitude, rate = params[P.height], params[P.amplitude], params[P.rate]
    reference[:] = 0.0
    # Starts at rest: 1 - cos, and its derivatives.
    reference[0, 2] = height + amplitude * (1.0 - math.cos(rate * t))
    reference[1, 2] = amplitude * rate * math.sin(rate * t)
    reference[2, 2] = amplitude * rate**2 * math.cos(rate * t)
    reference[3, 2] = -amplitude * rate**3 * math.sin(rate * t)


class Bob(ReferencePart):
    """Up and down about a fixed point."""

    kernel = bob

    height: float = 1.0
    """Lowest point, m."""
    amplitude: Annotated[float, Field(ge=0.0)] = 0.2
    """Half of the stroke, m."""
    period: Annotated[float, Field(gt=0.0)] = 4.0
    """Time of one stroke up and down, s."""

    def params(self, team):
        rate = 2.0 * math.pi / self.period
        return PARAMS.pack(team.n, height=self.height, amplitude=self.amplitude, rate=rate)
